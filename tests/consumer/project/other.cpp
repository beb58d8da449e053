// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/core/statistics.hpp>

#include "every_header.hpp"

double gate_of_the_other_file();

double gate_of_the_other_file() {
  return cairn::chi_square_quantile(0.95, 3);
}
