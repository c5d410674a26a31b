"""What the scene knows: messages become rows of declared tables, one ring for each topic."""
