"""What the verbs answer: compare, diagnose, add, explain, and the search for a formula."""
