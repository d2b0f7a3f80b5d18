"""What a test report states of a unit: each figure with its interval and how it was measured."""
