"""Many units: what is to be done, on this machine's cores or on a cluster, and what it shows."""
