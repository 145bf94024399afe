"""Records in, estimates out."""
