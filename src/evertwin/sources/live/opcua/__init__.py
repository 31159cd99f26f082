"""OPC UA: nodes that a server tells of, with their quality."""
