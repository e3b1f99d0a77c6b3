"""What service and worker share of the outside world: settings, tables, queries, blobs, jobs, codec."""
