"""The parts of which recipes for generated functions consist. A recipe says how one function is computed and tested;
the recipes are in psdmc/functions."""
