// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace adasfm {

// Functions of opencv2/imgcodecs.hpp, whose library is loaded at the first
// call: with it come some 100 others (GDAL, DICOM, HDF5, ...), which would take
// 0.18 of the 0.23 CPU seconds and 42 of the 65 MB of each command that needs
// no photo. Throw std::runtime_error where it cannot be loaded.

// cv::imread: flags of cv::ImreadModes; empty if the file is no image.
cv::Mat ReadImageFile(const std::string& path, int flags);

// cv::imencode: the bytes of a file with this extension (".png"), parameters of
// cv::ImwriteFlags.
std::vector<unsigned char> EncodeImage(const std::string& extension,
                                       const cv::Mat& image,
                                       const std::vector<int>& parameters = {});

}  // namespace adasfm
