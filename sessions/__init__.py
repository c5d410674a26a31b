"""What happened: recording, recovery, catalogue, replay and reproduction of sessions."""
