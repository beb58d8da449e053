// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Rig files: what is read is a rig that sees, and is the same rig when written and read again.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include <cairn/core/check.hpp>
#include <cairn/core/linalg.hpp>

#include "fuzz/scratch.hpp"
#include "support/rig_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  example::CalibratedRig rig;
  try {
    rig = example::parse_rig(cairn_fuzz::text_of(data, size), "rig.yaml");
  } catch (const cairn::Error& error) {
    cairn_fuzz::expect(std::string(error.what()).starts_with("rig.yaml"), "a refusal names the file");
    return cairn_fuzz::refused();
  }
  cairn_fuzz::expect(cairn::all_finite(rig.rig.T_left_right.matrix()) && rig.rig.baseline() > 0 &&
                         rig.rig.left.fx() > 0 && rig.rig.right.fy() > 0,
                     "a rig has a baseline and focal lengths");
  const auto sigma = rig.angle_sigma();
  cairn_fuzz::expect(!sigma || *sigma >= 0, "a sigma is not negative");
  if (rig.rig.left.width() == 0) return 0;  // OpenCV's need not say; cairn's does
  const example::CalibratedRig again = example::parse_rig(example::rig_text(rig), "rig.yaml");
  cairn_fuzz::expect(again.rig.left.fx() == rig.rig.left.fx() && again.rig.right.cy() == rig.rig.right.cy(),
                     "what was read can be written");
  return 0;
}
