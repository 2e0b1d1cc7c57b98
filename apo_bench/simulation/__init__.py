"""The only room that knows MuJoCo, mink and dm-control: scenes, hands, the arm, replay, pictures."""
