"""What happened: record, recover, list, replay."""
