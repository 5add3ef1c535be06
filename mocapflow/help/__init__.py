"""What is shown and made for people: equations, settings, new plugins from templates, what is shipped."""
