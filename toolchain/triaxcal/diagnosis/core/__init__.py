"""What every cause is judged with: readings in g, the model of a sound unit, the evidence."""
