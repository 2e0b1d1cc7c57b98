"""Import of data of your own: CAD parts, assemblies, tracker recordings."""
