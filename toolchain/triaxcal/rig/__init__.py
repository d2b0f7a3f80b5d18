"""The bench: from frames on a CAN bus to records that can be trusted."""
