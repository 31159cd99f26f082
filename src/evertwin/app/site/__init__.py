"""The commands of a site: serve, page, token, fleet, ros."""
