"""From the derivatives of a definition to the text of generated modules: printing, series, linear parts, writers."""
