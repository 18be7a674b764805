"""A fuzz of soft scenes: seeded scenes, laws as users write them, an independent solver, and a judge."""
