"""What is peculiar to checking each module: where its input comes from, and tests that only it needs."""
