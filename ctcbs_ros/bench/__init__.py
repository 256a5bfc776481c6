"""Speed and memory, each figure beside what people would use instead (`ctcbs bench`)."""
