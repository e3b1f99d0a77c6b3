"""Interactive plots, as Bokeh's json_item."""
