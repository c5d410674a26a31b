"""The wire: frames between a board and its gateway. Imports nothing of ours."""
