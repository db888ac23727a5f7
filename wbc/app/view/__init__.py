"""Live view in the browser: scene, page, server and the controls of a run."""
