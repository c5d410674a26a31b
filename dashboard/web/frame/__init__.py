"""The frame of the scene: its page, its policy, and what each role may send to it."""
