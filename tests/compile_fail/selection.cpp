// words: cairn: Selection<N, rows...> takes rows of the N x N identity
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/structured.hpp>

auto matrix() {
  return cairn::Selection<6, 0, 6>{}.dense();
}
