"""Evolution of state spaces with static units."""
