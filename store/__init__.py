"""Resources that service and worker share: settings, tables, queries, blobs, jobs, codec."""
