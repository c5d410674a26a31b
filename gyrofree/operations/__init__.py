"""What keeps an installation running: logs, figures, backups, the list of its parts."""
