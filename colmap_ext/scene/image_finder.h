// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/types.h"

namespace adasfm {

// Images by their name in the database and, where that is unique, by their file
// name: time lists often leave the folder out.
class ImageFinder {
 public:
  void Add(image_t image_id, const std::string& name);

  // kInvalidImageId when there is no such image.
  image_t Find(const std::string& name) const;
  // The image of the name or, where there is none, all images of its file name:
  // cameras of a rig often give theirs the same ones.
  std::vector<image_t> FindAll(const std::string& name) const;

 private:
  std::map<std::string, image_t> by_name_;
  std::map<std::string, std::vector<image_t>> by_file_name_;
};

}  // namespace adasfm
