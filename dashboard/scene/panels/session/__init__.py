"""What stands on the left for recordings: the recorder, the replay, notes and marks."""
