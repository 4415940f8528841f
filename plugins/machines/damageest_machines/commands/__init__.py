"""Commands that the plugin adds."""
