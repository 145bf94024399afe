"""What a server keeps: the ingest log, sites and radio maps, tracks, tokens, devices, and who did what."""
