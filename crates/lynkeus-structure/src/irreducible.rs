//! The block triangular form of a square matrix, by its pattern of zeros: a column for every row,
//! and then the strongly connected components of "row i reads the column of row k".

use std::collections::VecDeque;

use crate::Matrix;

/// The irreducible blocks on the diagonal of the block triangular form; none
/// where no permutation has a diagonal without zeros.
pub(crate) fn blocks<'g>(matrix: &Matrix<'g>) -> Option<Vec<Matrix<'g>>> {
    let column_of = transversal(matrix)?;
    let n = matrix.rows;
    // i is followed by k where row i reads the column that belongs to row k
    let follows = |i: usize, k: usize| matrix.get(i, column_of[k]).is_some();
    let reached: Vec<Vec<bool>> = (0..n)
        .map(|start| {
            let mut seen = vec![false; n];
            seen[start] = true;
            let mut open = vec![start];
            while let Some(i) = open.pop() {
                for k in (0..n).filter(|&k| follows(i, k)) {
                    if !std::mem::replace(&mut seen[k], true) {
                        open.push(k);
                    }
                }
            }
            seen
        })
        .collect();
    let together = |i: usize, k: usize| reached[i][k] && reached[k][i];
    let heads = (0..n).filter(|&i| (0..i).all(|k| !together(i, k)));
    let block = |head: usize| {
        let rows: Vec<usize> = (0..n).filter(|&k| together(head, k)).collect();
        Matrix::from_fn(matrix.graph(), (rows.len(), rows.len()), |i, j| {
            matrix.get(rows[i], column_of[rows[j]])
        })
    };
    Some(heads.map(block).collect())
}

/// A column for every row, all different, with entries that are not zero everywhere.
fn transversal(matrix: &Matrix<'_>) -> Option<Vec<usize>> {
    let n = matrix.rows;
    if matrix.columns != n {
        return None;
    }
    let mut row_of: Vec<Option<usize>> = vec![None; n];
    for start in 0..n {
        // breadth first: which row asked for the column
        let mut asked: Vec<Option<usize>> = vec![None; n];
        let mut open = VecDeque::from([start]);
        let mut free = None;
        while let Some(row) = open.pop_front() {
            for column in (0..n).filter(|&j| matrix.get(row, j).is_some()) {
                if asked[column].is_some() {
                    continue;
                }
                asked[column] = Some(row);
                match row_of[column] {
                    None => free = free.or(Some(column)),
                    Some(next) => open.push_back(next),
                }
            }
        }
        let mut column = free?;
        // the rows along the way move on by one column
        while let Some(row) = asked[column] {
            let before = row_of.iter().position(|&r| r == Some(row));
            row_of[column] = Some(row);
            match before {
                Some(left) if row != start => column = left,
                _ => break,
            }
        }
    }
    let mut column_of = vec![0; n];
    for (column, row) in row_of.into_iter().enumerate() {
        column_of[row?] = column;
    }
    Some(column_of)
}
