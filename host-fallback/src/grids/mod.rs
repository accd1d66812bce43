mod array_grid;
mod cell;
mod entries;
mod hash_grid;
mod nested_cell;
mod overfull_cells;
mod recursive_grid;
mod uniform_grid;
mod workspace;

pub(crate) use array_grid::ArrayGrid;
pub(crate) use hash_grid::HashGrid;
pub(crate) use recursive_grid::RecursiveGrid;

#[cfg(test)]
mod tests;
