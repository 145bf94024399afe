"""Sites: floors, walls, walkable space."""
