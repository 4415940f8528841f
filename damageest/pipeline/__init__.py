"""In which order: routes, the engine that calls stages, the cache, and the steps between stages."""
