"""What the services say of themselves, as figures that a Prometheus server collects."""
