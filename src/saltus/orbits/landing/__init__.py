"""How an orbit's segments end on the surfaces of events: residuals in time, durations along the flow."""
