// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/types.h"

namespace adasfm {

// Finds images by their name in the database and, where that is unique, by
// their file name: lists of times often omit the folder.
class ImageFinder {
 public:
  void Add(image_t image_id, const std::string& name);

  // kInvalidImageId when there is no such image, or the file name is not
  // unique.
  image_t Find(const std::string& name) const;
  // The image of the name or, where there is none, all images of its file name:
  // cameras of a rig often use the same file names.
  std::vector<image_t> FindAll(const std::string& name) const;

 private:
  std::map<std::string, image_t> by_name_;
  std::map<std::string, std::vector<image_t>> by_file_name_;
};

}  // namespace adasfm
