"""The REST service: HTTP in front of the job records, the queue and the stored files."""
