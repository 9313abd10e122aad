"""The values that the worker and the page exchange: plain data, no objects of the engine and no widgets."""
