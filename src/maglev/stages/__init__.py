"""The stages of the workflow: one module per rule, datasets in, one dataset out."""
