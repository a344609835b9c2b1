// SPDX-License-Identifier: BSD-3-Clause
// Options of adasfm_synthesizer for values that a camera sets itself (focal
// length, exposure), as a user gives them: each reaches world.json or causes an
// error.

#include <gtest/gtest.h>

#include "tests/testing/colmap_ext/command_line_fixture.h"

namespace adasfm {
namespace {

class SynthesizerTest : public CommandLineTest {
 protected:
  // world.json of a small world with these options.
  std::string MakeWorld(const std::string& options) {
    const Run run = Call(command_ + options);
    EXPECT_EQ(run.ExitCode(), 0) << run.err;
    return ReadBytes(folder_.File("world/world.json"));
  }

  void ExpectFigures(const std::string& options,
                     const std::vector<std::string>& figures) {
    const std::string text = MakeWorld(options);
    for (const std::string& figure : figures) {
      EXPECT_NE(text.find(figure), std::string::npos) << figure << text;
    }
  }

  const std::string command_ =
      "adasfm_synthesizer --num_images 11 --num_keypoints 40 --image_width 96 "
      "--image_height 64 --output_path " +
      folder_.File("world") + " ";
};

TEST_F(SynthesizerTest, FocalLengthsReachTheirValueWithoutPhotos) {
  ExpectFigures("--focal_breathing 0.015",
                {"\"max_focal_error_percent\": 1.5"});
  const std::string wave = ReadBytes(folder_.File("world/database.db"));
  ExpectFigures("--focal_breathing 0.015 --focal_steps 3",
                {"\"max_focal_error_percent\": 1.5"});
  EXPECT_NE(ReadBytes(folder_.File("world/database.db")), wave);
}

TEST_F(SynthesizerTest, PhotosReachTheirValues) {
  ExpectFigures(
      "--render 1 --exposure_jumps 0.3 --exposure_factor 2.5",
      {"\"exposure_jump_ratio\": 0.3,", "\"max_exposure_factor\": 2.5\n"});
  ExpectFigures(
      "--render 1 --exposure_time 0.02",
      {"\"mean_blur_px\": ", "\"max_blur_px\": ", "\"blurred_photo_ratio\": "});
}

TEST_F(SynthesizerTest, FiguresOfUnusedOptionsAreAbsent) {
  const std::string text = MakeWorld("");
  for (const char* name : {"exposure", "blur", "focal"}) {
    EXPECT_EQ(text.find(name), std::string::npos) << text;
  }
}

TEST_F(SynthesizerTest, ImpossibleValuesAreErrors) {
  ExpectError(command_ + "--exposure_time 0.02",
              "exposure_time = 0.02 needs render = 1");
  ExpectError(command_ + "--exposure_jumps 0.2",
              "exposure_jumps = 0.2 needs render = 1");
  ExpectError(command_ + "--render 1 --exposure_time 0.2",
              "exposure_time_s = 0.2 must be from 0 to 0.1");
  ExpectError(command_ + "--render 1 --exposure_jumps 2",
              "--exposure_jumps: exposure_jump_ratio = 2 must be from 0 to 1");
  ExpectError(
      command_ + "--exposure_factor 0.5",
      "--exposure_factor: exposure_jump_factor = 0.5 must be from 1.1 to 16");
  ExpectError(command_ + "--focal_breathing 0.5",
              "focal_breathing_ratio = 0.5 must be from 0 to 0.2");
  ExpectError(command_ + "--focal_steps 11",
              "num_focal_steps = 11 must be less than num_images");
}

}  // namespace
}  // namespace adasfm
