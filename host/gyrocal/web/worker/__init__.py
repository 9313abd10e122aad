"""The worker process: it asks the engine and prepares what the page shows."""
