"""`make bench`: how fast we are, beside what people use today and beside the limit, as ratios of one run."""
