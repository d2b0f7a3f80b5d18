"""What a delivery becomes for others: layouts for build systems, parameters for autopilots."""
