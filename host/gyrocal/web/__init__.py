"""The workbench: a local page from "does my model fit?" to "this is what was missing". No logic of diagnosis is in it."""
