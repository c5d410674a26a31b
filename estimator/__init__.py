"""The service: samples from the bus become motion on the bus. The mathematics is in inertial/."""
