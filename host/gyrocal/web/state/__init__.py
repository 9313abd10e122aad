"""What all tabs share: the session, its models, the jobs and the files."""
