"""Arms and cameras that go wrong on schedule: wrapped around any other driver, by configuration."""
