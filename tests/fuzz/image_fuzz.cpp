// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Images of a recorded drive, PNG or PGM: a picture that is read comes back from a PNG as it was.
#include <cstddef>
#include <cstdint>

#include <cairn/core/check.hpp>
#include <cairn/vision/image.hpp>

#include "fuzz/scratch.hpp"
#include "support/image_io.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  try {
    const cairn::Image image = example::read_image(scratch.put("a.png", cairn_fuzz::text_of(data, size)));
    cairn_fuzz::expect(!image.empty(), "an image has pixels");
    example::write_png(scratch / "b.png", image);
    cairn_fuzz::expect(example::read_image(scratch / "b.png") == image, "a picture comes back");
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
