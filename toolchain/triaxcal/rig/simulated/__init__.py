"""The simulated rig: exact physics, frames and faults."""
