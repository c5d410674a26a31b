"""Pages that lead a person through a procedure step by step."""
