"""From the box to a configuration: what is attached, what is asked, what is written."""
