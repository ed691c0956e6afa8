"""Tools for the data behind a benchmark: from raw clips and annotations to clips, boxes and truth."""
