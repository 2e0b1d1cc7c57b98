"""The scene: room, parts and arm as MuJoCo models, and pictures of them."""
