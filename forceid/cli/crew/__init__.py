"""Who does the files of a batch: processes, clusters, what is done already, and how far it is."""
