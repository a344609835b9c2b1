// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>

#include "core/types.h"

namespace adasfm {

// Images by their name in the database and, where that is unique, by their file
// name: time lists often leave the folder out.
class ImageFinder {
 public:
  void Add(image_t image_id, const std::string& name);

  // kInvalidImageId when there is no such image.
  image_t Find(const std::string& name) const;

 private:
  std::map<std::string, image_t> by_name_;
  // kInvalidImageId: several images have that file name.
  std::map<std::string, image_t> by_file_name_;
};

}  // namespace adasfm
