"""The frame that viser's scene stands in: its page, its policy, and what each role may send to it."""
