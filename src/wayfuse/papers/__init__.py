"""The published systems, held against the tables of their papers: one file per paper, run by ``wayfuse reproduce``."""
