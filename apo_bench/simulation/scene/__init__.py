"""The scene: room, parts and arm as MuJoCo models, pictures of them, and where parts come to rest when let go."""
