"""What YAML files say: documents and their places, pipelines, experiments."""
