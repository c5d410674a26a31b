"""Pictures of what the runs of logs gave."""
