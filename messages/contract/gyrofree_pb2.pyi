from google.protobuf import descriptor_pb2 as _descriptor_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Source(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SOURCE_UNKNOWN: _ClassVar[Source]
    SOURCE_HARDWARE: _ClassVar[Source]
    SOURCE_SIMULATED: _ClassVar[Source]
    SOURCE_EMULATED: _ClassVar[Source]
    SOURCE_PLAYED: _ClassVar[Source]

class HeightReference(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    HEIGHT_REFERENCE_UNSAID: _ClassVar[HeightReference]
    HEIGHT_REFERENCE_ELLIPSOID: _ClassVar[HeightReference]
    HEIGHT_REFERENCE_SEA_LEVEL: _ClassVar[HeightReference]
    HEIGHT_REFERENCE_UNKNOWN: _ClassVar[HeightReference]
SOURCE_UNKNOWN: Source
SOURCE_HARDWARE: Source
SOURCE_SIMULATED: Source
SOURCE_EMULATED: Source
SOURCE_PLAYED: Source
HEIGHT_REFERENCE_UNSAID: HeightReference
HEIGHT_REFERENCE_ELLIPSOID: HeightReference
HEIGHT_REFERENCE_SEA_LEVEL: HeightReference
HEIGHT_REFERENCE_UNKNOWN: HeightReference
RULE_FIELD_NUMBER: _ClassVar[int]
rule: _descriptor.FieldDescriptor
OPEN_FIELD_NUMBER: _ClassVar[int]
open: _descriptor.FieldDescriptor

class Rule(_message.Message):
    __slots__ = ("min", "max", "most", "row", "columns", "name", "none")
    MIN_FIELD_NUMBER: _ClassVar[int]
    MAX_FIELD_NUMBER: _ClassVar[int]
    MOST_FIELD_NUMBER: _ClassVar[int]
    ROW_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NONE_FIELD_NUMBER: _ClassVar[int]
    min: float
    max: float
    most: int
    row: int
    columns: str
    name: bool
    none: bool
    def __init__(self, min: _Optional[float] = ..., max: _Optional[float] = ..., most: _Optional[int] = ..., row: _Optional[int] = ..., columns: _Optional[str] = ..., name: _Optional[bool] = ..., none: _Optional[bool] = ...) -> None: ...

class Header(_message.Message):
    __slots__ = ("device", "sequence", "epoch", "device_us", "utc_ns", "utc_sigma_s", "source", "run", "late")
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    DEVICE_US_FIELD_NUMBER: _ClassVar[int]
    UTC_NS_FIELD_NUMBER: _ClassVar[int]
    UTC_SIGMA_S_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    RUN_FIELD_NUMBER: _ClassVar[int]
    LATE_FIELD_NUMBER: _ClassVar[int]
    device: str
    sequence: int
    epoch: int
    device_us: int
    utc_ns: int
    utc_sigma_s: float
    source: Source
    run: int
    late: bool
    def __init__(self, device: _Optional[str] = ..., sequence: _Optional[int] = ..., epoch: _Optional[int] = ..., device_us: _Optional[int] = ..., utc_ns: _Optional[int] = ..., utc_sigma_s: _Optional[float] = ..., source: _Optional[_Union[Source, str]] = ..., run: _Optional[int] = ..., late: _Optional[bool] = ...) -> None: ...

class AccelBatch(_message.Message):
    __slots__ = ("header", "first_index", "period_s", "axes", "counts", "f_mps2", "stale_mask", "lost_samples", "frame_sequence", "received_ns", "axis_offset_s")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    FIRST_INDEX_FIELD_NUMBER: _ClassVar[int]
    PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    AXES_FIELD_NUMBER: _ClassVar[int]
    COUNTS_FIELD_NUMBER: _ClassVar[int]
    F_MPS2_FIELD_NUMBER: _ClassVar[int]
    STALE_MASK_FIELD_NUMBER: _ClassVar[int]
    LOST_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    FRAME_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_NS_FIELD_NUMBER: _ClassVar[int]
    AXIS_OFFSET_S_FIELD_NUMBER: _ClassVar[int]
    header: Header
    first_index: int
    period_s: float
    axes: int
    counts: _containers.RepeatedScalarFieldContainer[int]
    f_mps2: _containers.RepeatedScalarFieldContainer[float]
    stale_mask: int
    lost_samples: int
    frame_sequence: int
    received_ns: int
    axis_offset_s: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., first_index: _Optional[int] = ..., period_s: _Optional[float] = ..., axes: _Optional[int] = ..., counts: _Optional[_Iterable[int]] = ..., f_mps2: _Optional[_Iterable[float]] = ..., stale_mask: _Optional[int] = ..., lost_samples: _Optional[int] = ..., frame_sequence: _Optional[int] = ..., received_ns: _Optional[int] = ..., axis_offset_s: _Optional[_Iterable[float]] = ...) -> None: ...

class ImuBatch(_message.Message):
    __slots__ = ("header", "first_index", "period_s", "f_b_mps2", "omega_ib_b_radps", "lost_samples", "frame_sequence", "received_ns")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    FIRST_INDEX_FIELD_NUMBER: _ClassVar[int]
    PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    OMEGA_IB_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    LOST_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    FRAME_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_NS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    first_index: int
    period_s: float
    f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    omega_ib_b_radps: _containers.RepeatedScalarFieldContainer[float]
    lost_samples: int
    frame_sequence: int
    received_ns: int
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., first_index: _Optional[int] = ..., period_s: _Optional[float] = ..., f_b_mps2: _Optional[_Iterable[float]] = ..., omega_ib_b_radps: _Optional[_Iterable[float]] = ..., lost_samples: _Optional[int] = ..., frame_sequence: _Optional[int] = ..., received_ns: _Optional[int] = ...) -> None: ...

class TachoRate(_message.Message):
    __slots__ = ("header", "omega_radps", "sigma_radps", "pulses", "direction_known")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    OMEGA_RADPS_FIELD_NUMBER: _ClassVar[int]
    SIGMA_RADPS_FIELD_NUMBER: _ClassVar[int]
    PULSES_FIELD_NUMBER: _ClassVar[int]
    DIRECTION_KNOWN_FIELD_NUMBER: _ClassVar[int]
    header: Header
    omega_radps: float
    sigma_radps: float
    pulses: int
    direction_known: bool
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., omega_radps: _Optional[float] = ..., sigma_radps: _Optional[float] = ..., pulses: _Optional[int] = ..., direction_known: _Optional[bool] = ...) -> None: ...

class GnssFix(_message.Message):
    __slots__ = ("header", "fix_utc_ns", "latitude_deg", "longitude_deg", "height_m", "height_msl_m", "position_sigma_ned_m", "v_n_mps", "velocity_sigma_ned_mps", "quality", "satellites", "hdop", "talker", "device_time_s", "height_reference")
    class Quality(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        QUALITY_NONE: _ClassVar[GnssFix.Quality]
        QUALITY_AUTONOMOUS: _ClassVar[GnssFix.Quality]
        QUALITY_DIFFERENTIAL: _ClassVar[GnssFix.Quality]
        QUALITY_RTK_FLOAT: _ClassVar[GnssFix.Quality]
        QUALITY_RTK_FIXED: _ClassVar[GnssFix.Quality]
        QUALITY_DEAD_RECKONING: _ClassVar[GnssFix.Quality]
    QUALITY_NONE: GnssFix.Quality
    QUALITY_AUTONOMOUS: GnssFix.Quality
    QUALITY_DIFFERENTIAL: GnssFix.Quality
    QUALITY_RTK_FLOAT: GnssFix.Quality
    QUALITY_RTK_FIXED: GnssFix.Quality
    QUALITY_DEAD_RECKONING: GnssFix.Quality
    HEADER_FIELD_NUMBER: _ClassVar[int]
    FIX_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    LATITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    LONGITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_MSL_M_FIELD_NUMBER: _ClassVar[int]
    POSITION_SIGMA_NED_M_FIELD_NUMBER: _ClassVar[int]
    V_N_MPS_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_SIGMA_NED_MPS_FIELD_NUMBER: _ClassVar[int]
    QUALITY_FIELD_NUMBER: _ClassVar[int]
    SATELLITES_FIELD_NUMBER: _ClassVar[int]
    HDOP_FIELD_NUMBER: _ClassVar[int]
    TALKER_FIELD_NUMBER: _ClassVar[int]
    DEVICE_TIME_S_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_REFERENCE_FIELD_NUMBER: _ClassVar[int]
    header: Header
    fix_utc_ns: int
    latitude_deg: float
    longitude_deg: float
    height_m: float
    height_msl_m: float
    position_sigma_ned_m: _containers.RepeatedScalarFieldContainer[float]
    v_n_mps: _containers.RepeatedScalarFieldContainer[float]
    velocity_sigma_ned_mps: _containers.RepeatedScalarFieldContainer[float]
    quality: GnssFix.Quality
    satellites: int
    hdop: float
    talker: str
    device_time_s: float
    height_reference: HeightReference
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., fix_utc_ns: _Optional[int] = ..., latitude_deg: _Optional[float] = ..., longitude_deg: _Optional[float] = ..., height_m: _Optional[float] = ..., height_msl_m: _Optional[float] = ..., position_sigma_ned_m: _Optional[_Iterable[float]] = ..., v_n_mps: _Optional[_Iterable[float]] = ..., velocity_sigma_ned_mps: _Optional[_Iterable[float]] = ..., quality: _Optional[_Union[GnssFix.Quality, str]] = ..., satellites: _Optional[int] = ..., hdop: _Optional[float] = ..., talker: _Optional[str] = ..., device_time_s: _Optional[float] = ..., height_reference: _Optional[_Union[HeightReference, str]] = ...) -> None: ...

class Sky(_message.Message):
    __slots__ = ("header", "talker", "satellites")
    class Constellation(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        CONSTELLATION_UNKNOWN: _ClassVar[Sky.Constellation]
        CONSTELLATION_GPS: _ClassVar[Sky.Constellation]
        CONSTELLATION_SBAS: _ClassVar[Sky.Constellation]
        CONSTELLATION_GALILEO: _ClassVar[Sky.Constellation]
        CONSTELLATION_BEIDOU: _ClassVar[Sky.Constellation]
        CONSTELLATION_QZSS: _ClassVar[Sky.Constellation]
        CONSTELLATION_GLONASS: _ClassVar[Sky.Constellation]
        CONSTELLATION_NAVIC: _ClassVar[Sky.Constellation]
    CONSTELLATION_UNKNOWN: Sky.Constellation
    CONSTELLATION_GPS: Sky.Constellation
    CONSTELLATION_SBAS: Sky.Constellation
    CONSTELLATION_GALILEO: Sky.Constellation
    CONSTELLATION_BEIDOU: Sky.Constellation
    CONSTELLATION_QZSS: Sky.Constellation
    CONSTELLATION_GLONASS: Sky.Constellation
    CONSTELLATION_NAVIC: Sky.Constellation
    class Use(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        USE_UNKNOWN: _ClassVar[Sky.Use]
        USE_NO: _ClassVar[Sky.Use]
        USE_YES: _ClassVar[Sky.Use]
    USE_UNKNOWN: Sky.Use
    USE_NO: Sky.Use
    USE_YES: Sky.Use
    class Satellite(_message.Message):
        __slots__ = ("name", "constellation", "number", "elevation_deg", "azimuth_deg", "cn0_dbhz", "use", "signals")
        NAME_FIELD_NUMBER: _ClassVar[int]
        CONSTELLATION_FIELD_NUMBER: _ClassVar[int]
        NUMBER_FIELD_NUMBER: _ClassVar[int]
        ELEVATION_DEG_FIELD_NUMBER: _ClassVar[int]
        AZIMUTH_DEG_FIELD_NUMBER: _ClassVar[int]
        CN0_DBHZ_FIELD_NUMBER: _ClassVar[int]
        USE_FIELD_NUMBER: _ClassVar[int]
        SIGNALS_FIELD_NUMBER: _ClassVar[int]
        name: str
        constellation: Sky.Constellation
        number: int
        elevation_deg: float
        azimuth_deg: float
        cn0_dbhz: float
        use: Sky.Use
        signals: int
        def __init__(self, name: _Optional[str] = ..., constellation: _Optional[_Union[Sky.Constellation, str]] = ..., number: _Optional[int] = ..., elevation_deg: _Optional[float] = ..., azimuth_deg: _Optional[float] = ..., cn0_dbhz: _Optional[float] = ..., use: _Optional[_Union[Sky.Use, str]] = ..., signals: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TALKER_FIELD_NUMBER: _ClassVar[int]
    SATELLITES_FIELD_NUMBER: _ClassVar[int]
    header: Header
    talker: str
    satellites: _containers.RepeatedCompositeFieldContainer[Sky.Satellite]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., talker: _Optional[str] = ..., satellites: _Optional[_Iterable[_Union[Sky.Satellite, _Mapping]]] = ...) -> None: ...

class LinkStatus(_message.Message):
    __slots__ = ("header", "connected", "port", "message", "bytes_in", "good_frames", "good_bytes", "bad_chunks", "bad_bytes", "pending_bytes", "lost_frames", "device_dropped", "lost_samples", "reboots", "unknown_frames", "reconnects", "sample_rate_hz", "frame_rate_hz", "latency_p50_s", "latency_p99_s", "clock_skew_ppm", "clock_residual_s", "clock_window_s", "journal_sequence", "durable_sequence", "gnss_good", "gnss_bad", "damage", "published_sequence", "published_durable", "refused", "stops", "stopped_s", "clock_offset_s")
    class DamageEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    class RefusedEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    CONNECTED_FIELD_NUMBER: _ClassVar[int]
    PORT_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    BYTES_IN_FIELD_NUMBER: _ClassVar[int]
    GOOD_FRAMES_FIELD_NUMBER: _ClassVar[int]
    GOOD_BYTES_FIELD_NUMBER: _ClassVar[int]
    BAD_CHUNKS_FIELD_NUMBER: _ClassVar[int]
    BAD_BYTES_FIELD_NUMBER: _ClassVar[int]
    PENDING_BYTES_FIELD_NUMBER: _ClassVar[int]
    LOST_FRAMES_FIELD_NUMBER: _ClassVar[int]
    DEVICE_DROPPED_FIELD_NUMBER: _ClassVar[int]
    LOST_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    REBOOTS_FIELD_NUMBER: _ClassVar[int]
    UNKNOWN_FRAMES_FIELD_NUMBER: _ClassVar[int]
    RECONNECTS_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    FRAME_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    LATENCY_P50_S_FIELD_NUMBER: _ClassVar[int]
    LATENCY_P99_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_SKEW_PPM_FIELD_NUMBER: _ClassVar[int]
    CLOCK_RESIDUAL_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_WINDOW_S_FIELD_NUMBER: _ClassVar[int]
    JOURNAL_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    DURABLE_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    GNSS_GOOD_FIELD_NUMBER: _ClassVar[int]
    GNSS_BAD_FIELD_NUMBER: _ClassVar[int]
    DAMAGE_FIELD_NUMBER: _ClassVar[int]
    PUBLISHED_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    PUBLISHED_DURABLE_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    STOPS_FIELD_NUMBER: _ClassVar[int]
    STOPPED_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_OFFSET_S_FIELD_NUMBER: _ClassVar[int]
    header: Header
    connected: bool
    port: str
    message: str
    bytes_in: int
    good_frames: int
    good_bytes: int
    bad_chunks: int
    bad_bytes: int
    pending_bytes: int
    lost_frames: int
    device_dropped: int
    lost_samples: int
    reboots: int
    unknown_frames: int
    reconnects: int
    sample_rate_hz: float
    frame_rate_hz: float
    latency_p50_s: float
    latency_p99_s: float
    clock_skew_ppm: float
    clock_residual_s: float
    clock_window_s: float
    journal_sequence: int
    durable_sequence: int
    gnss_good: int
    gnss_bad: int
    damage: _containers.ScalarMap[str, int]
    published_sequence: int
    published_durable: int
    refused: _containers.ScalarMap[str, int]
    stops: int
    stopped_s: float
    clock_offset_s: float
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., connected: _Optional[bool] = ..., port: _Optional[str] = ..., message: _Optional[str] = ..., bytes_in: _Optional[int] = ..., good_frames: _Optional[int] = ..., good_bytes: _Optional[int] = ..., bad_chunks: _Optional[int] = ..., bad_bytes: _Optional[int] = ..., pending_bytes: _Optional[int] = ..., lost_frames: _Optional[int] = ..., device_dropped: _Optional[int] = ..., lost_samples: _Optional[int] = ..., reboots: _Optional[int] = ..., unknown_frames: _Optional[int] = ..., reconnects: _Optional[int] = ..., sample_rate_hz: _Optional[float] = ..., frame_rate_hz: _Optional[float] = ..., latency_p50_s: _Optional[float] = ..., latency_p99_s: _Optional[float] = ..., clock_skew_ppm: _Optional[float] = ..., clock_residual_s: _Optional[float] = ..., clock_window_s: _Optional[float] = ..., journal_sequence: _Optional[int] = ..., durable_sequence: _Optional[int] = ..., gnss_good: _Optional[int] = ..., gnss_bad: _Optional[int] = ..., damage: _Optional[_Mapping[str, int]] = ..., published_sequence: _Optional[int] = ..., published_durable: _Optional[int] = ..., refused: _Optional[_Mapping[str, int]] = ..., stops: _Optional[int] = ..., stopped_s: _Optional[float] = ..., clock_offset_s: _Optional[float] = ...) -> None: ...

class BoardInfo(_message.Message):
    __slots__ = ("header", "board_id", "uid", "firmware", "axes", "sample_period_s", "status", "faults")
    class StatusEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    BOARD_ID_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    FIRMWARE_FIELD_NUMBER: _ClassVar[int]
    AXES_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    FAULTS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    board_id: int
    uid: str
    firmware: str
    axes: int
    sample_period_s: float
    status: _containers.ScalarMap[str, int]
    faults: _containers.RepeatedCompositeFieldContainer[Fault]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., board_id: _Optional[int] = ..., uid: _Optional[str] = ..., firmware: _Optional[str] = ..., axes: _Optional[int] = ..., sample_period_s: _Optional[float] = ..., status: _Optional[_Mapping[str, int]] = ..., faults: _Optional[_Iterable[_Union[Fault, _Mapping]]] = ...) -> None: ...

class Fault(_message.Message):
    __slots__ = ("name", "text", "since_utc_ns", "active")
    NAME_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    SINCE_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    ACTIVE_FIELD_NUMBER: _ClassVar[int]
    name: str
    text: str
    since_utc_ns: int
    active: bool
    def __init__(self, name: _Optional[str] = ..., text: _Optional[str] = ..., since_utc_ns: _Optional[int] = ..., active: _Optional[bool] = ...) -> None: ...

class AdcBatch(_message.Message):
    __slots__ = ("header", "first_index", "period_s", "channels", "counts", "volt_per_count", "lost_samples", "frame_sequence", "received_ns", "channel_mask", "zero_g_v", "accel_v_per_mps2", "zero_rate_v", "gyro_v_per_radps")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    FIRST_INDEX_FIELD_NUMBER: _ClassVar[int]
    PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    CHANNELS_FIELD_NUMBER: _ClassVar[int]
    COUNTS_FIELD_NUMBER: _ClassVar[int]
    VOLT_PER_COUNT_FIELD_NUMBER: _ClassVar[int]
    LOST_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    FRAME_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_NS_FIELD_NUMBER: _ClassVar[int]
    CHANNEL_MASK_FIELD_NUMBER: _ClassVar[int]
    ZERO_G_V_FIELD_NUMBER: _ClassVar[int]
    ACCEL_V_PER_MPS2_FIELD_NUMBER: _ClassVar[int]
    ZERO_RATE_V_FIELD_NUMBER: _ClassVar[int]
    GYRO_V_PER_RADPS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    first_index: int
    period_s: float
    channels: int
    counts: _containers.RepeatedScalarFieldContainer[int]
    volt_per_count: float
    lost_samples: int
    frame_sequence: int
    received_ns: int
    channel_mask: int
    zero_g_v: float
    accel_v_per_mps2: float
    zero_rate_v: float
    gyro_v_per_radps: float
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., first_index: _Optional[int] = ..., period_s: _Optional[float] = ..., channels: _Optional[int] = ..., counts: _Optional[_Iterable[int]] = ..., volt_per_count: _Optional[float] = ..., lost_samples: _Optional[int] = ..., frame_sequence: _Optional[int] = ..., received_ns: _Optional[int] = ..., channel_mask: _Optional[int] = ..., zero_g_v: _Optional[float] = ..., accel_v_per_mps2: _Optional[float] = ..., zero_rate_v: _Optional[float] = ..., gyro_v_per_radps: _Optional[float] = ...) -> None: ...

class RateBatch(_message.Message):
    __slots__ = ("header", "estimator", "for_sequence", "for_index", "omega_ib_b_radps", "omega_covariance", "alpha_b_radps2", "f_b_mps2", "q_nb", "angle_z_rad", "innovation", "innovation_sigma", "nis", "nis_dof", "still", "p_n_m", "v_n_mps", "bias", "innovation_unit", "sight", "sight_reason", "bound_sigma_radps", "calibration", "excluded_mask", "aid", "period_s", "index_step")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    FOR_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FOR_INDEX_FIELD_NUMBER: _ClassVar[int]
    OMEGA_IB_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    OMEGA_COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    ALPHA_B_RADPS2_FIELD_NUMBER: _ClassVar[int]
    F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    Q_NB_FIELD_NUMBER: _ClassVar[int]
    ANGLE_Z_RAD_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_SIGMA_FIELD_NUMBER: _ClassVar[int]
    NIS_FIELD_NUMBER: _ClassVar[int]
    NIS_DOF_FIELD_NUMBER: _ClassVar[int]
    STILL_FIELD_NUMBER: _ClassVar[int]
    P_N_M_FIELD_NUMBER: _ClassVar[int]
    V_N_MPS_FIELD_NUMBER: _ClassVar[int]
    BIAS_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_UNIT_FIELD_NUMBER: _ClassVar[int]
    SIGHT_FIELD_NUMBER: _ClassVar[int]
    SIGHT_REASON_FIELD_NUMBER: _ClassVar[int]
    BOUND_SIGMA_RADPS_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_FIELD_NUMBER: _ClassVar[int]
    EXCLUDED_MASK_FIELD_NUMBER: _ClassVar[int]
    AID_FIELD_NUMBER: _ClassVar[int]
    PERIOD_S_FIELD_NUMBER: _ClassVar[int]
    INDEX_STEP_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    for_sequence: int
    for_index: int
    omega_ib_b_radps: _containers.RepeatedScalarFieldContainer[float]
    omega_covariance: _containers.RepeatedScalarFieldContainer[float]
    alpha_b_radps2: _containers.RepeatedScalarFieldContainer[float]
    f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    q_nb: _containers.RepeatedScalarFieldContainer[float]
    angle_z_rad: _containers.RepeatedScalarFieldContainer[float]
    innovation: _containers.RepeatedScalarFieldContainer[float]
    innovation_sigma: _containers.RepeatedScalarFieldContainer[float]
    nis: _containers.RepeatedScalarFieldContainer[float]
    nis_dof: _containers.RepeatedScalarFieldContainer[int]
    still: _containers.RepeatedScalarFieldContainer[bool]
    p_n_m: _containers.RepeatedScalarFieldContainer[float]
    v_n_mps: _containers.RepeatedScalarFieldContainer[float]
    bias: _containers.RepeatedScalarFieldContainer[float]
    innovation_unit: str
    sight: _containers.RepeatedScalarFieldContainer[RateEstimate.Sight]
    sight_reason: str
    bound_sigma_radps: _containers.RepeatedScalarFieldContainer[float]
    calibration: str
    excluded_mask: int
    aid: str
    period_s: float
    index_step: int
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., for_sequence: _Optional[int] = ..., for_index: _Optional[int] = ..., omega_ib_b_radps: _Optional[_Iterable[float]] = ..., omega_covariance: _Optional[_Iterable[float]] = ..., alpha_b_radps2: _Optional[_Iterable[float]] = ..., f_b_mps2: _Optional[_Iterable[float]] = ..., q_nb: _Optional[_Iterable[float]] = ..., angle_z_rad: _Optional[_Iterable[float]] = ..., innovation: _Optional[_Iterable[float]] = ..., innovation_sigma: _Optional[_Iterable[float]] = ..., nis: _Optional[_Iterable[float]] = ..., nis_dof: _Optional[_Iterable[int]] = ..., still: _Optional[_Iterable[bool]] = ..., p_n_m: _Optional[_Iterable[float]] = ..., v_n_mps: _Optional[_Iterable[float]] = ..., bias: _Optional[_Iterable[float]] = ..., innovation_unit: _Optional[str] = ..., sight: _Optional[_Iterable[_Union[RateEstimate.Sight, str]]] = ..., sight_reason: _Optional[str] = ..., bound_sigma_radps: _Optional[_Iterable[float]] = ..., calibration: _Optional[str] = ..., excluded_mask: _Optional[int] = ..., aid: _Optional[str] = ..., period_s: _Optional[float] = ..., index_step: _Optional[int] = ...) -> None: ...

class RateEstimate(_message.Message):
    __slots__ = ("header", "estimator", "for_sequence", "for_index", "omega_ib_b_radps", "omega_covariance", "alpha_b_radps2", "f_b_mps2", "q_nb", "angle_z_rad", "innovation", "innovation_sigma", "nis", "nis_dof", "still", "p_n_m", "v_n_mps", "bias", "innovation_unit", "sight", "sight_reason", "bound_sigma_radps", "calibration", "excluded_mask", "aid")
    class Sight(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        SIGHT_VALID: _ClassVar[RateEstimate.Sight]
        SIGHT_AMBIGUOUS: _ClassVar[RateEstimate.Sight]
        SIGHT_BLIND: _ClassVar[RateEstimate.Sight]
    SIGHT_VALID: RateEstimate.Sight
    SIGHT_AMBIGUOUS: RateEstimate.Sight
    SIGHT_BLIND: RateEstimate.Sight
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    FOR_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FOR_INDEX_FIELD_NUMBER: _ClassVar[int]
    OMEGA_IB_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    OMEGA_COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    ALPHA_B_RADPS2_FIELD_NUMBER: _ClassVar[int]
    F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    Q_NB_FIELD_NUMBER: _ClassVar[int]
    ANGLE_Z_RAD_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_SIGMA_FIELD_NUMBER: _ClassVar[int]
    NIS_FIELD_NUMBER: _ClassVar[int]
    NIS_DOF_FIELD_NUMBER: _ClassVar[int]
    STILL_FIELD_NUMBER: _ClassVar[int]
    P_N_M_FIELD_NUMBER: _ClassVar[int]
    V_N_MPS_FIELD_NUMBER: _ClassVar[int]
    BIAS_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_UNIT_FIELD_NUMBER: _ClassVar[int]
    SIGHT_FIELD_NUMBER: _ClassVar[int]
    SIGHT_REASON_FIELD_NUMBER: _ClassVar[int]
    BOUND_SIGMA_RADPS_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_FIELD_NUMBER: _ClassVar[int]
    EXCLUDED_MASK_FIELD_NUMBER: _ClassVar[int]
    AID_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    for_sequence: int
    for_index: int
    omega_ib_b_radps: _containers.RepeatedScalarFieldContainer[float]
    omega_covariance: _containers.RepeatedScalarFieldContainer[float]
    alpha_b_radps2: _containers.RepeatedScalarFieldContainer[float]
    f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    q_nb: _containers.RepeatedScalarFieldContainer[float]
    angle_z_rad: float
    innovation: _containers.RepeatedScalarFieldContainer[float]
    innovation_sigma: _containers.RepeatedScalarFieldContainer[float]
    nis: float
    nis_dof: int
    still: bool
    p_n_m: _containers.RepeatedScalarFieldContainer[float]
    v_n_mps: _containers.RepeatedScalarFieldContainer[float]
    bias: _containers.RepeatedScalarFieldContainer[float]
    innovation_unit: str
    sight: _containers.RepeatedScalarFieldContainer[RateEstimate.Sight]
    sight_reason: str
    bound_sigma_radps: _containers.RepeatedScalarFieldContainer[float]
    calibration: str
    excluded_mask: int
    aid: str
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., for_sequence: _Optional[int] = ..., for_index: _Optional[int] = ..., omega_ib_b_radps: _Optional[_Iterable[float]] = ..., omega_covariance: _Optional[_Iterable[float]] = ..., alpha_b_radps2: _Optional[_Iterable[float]] = ..., f_b_mps2: _Optional[_Iterable[float]] = ..., q_nb: _Optional[_Iterable[float]] = ..., angle_z_rad: _Optional[float] = ..., innovation: _Optional[_Iterable[float]] = ..., innovation_sigma: _Optional[_Iterable[float]] = ..., nis: _Optional[float] = ..., nis_dof: _Optional[int] = ..., still: _Optional[bool] = ..., p_n_m: _Optional[_Iterable[float]] = ..., v_n_mps: _Optional[_Iterable[float]] = ..., bias: _Optional[_Iterable[float]] = ..., innovation_unit: _Optional[str] = ..., sight: _Optional[_Iterable[_Union[RateEstimate.Sight, str]]] = ..., sight_reason: _Optional[str] = ..., bound_sigma_radps: _Optional[_Iterable[float]] = ..., calibration: _Optional[str] = ..., excluded_mask: _Optional[int] = ..., aid: _Optional[str] = ...) -> None: ...

class NavSolution(_message.Message):
    __slots__ = ("header", "estimator", "for_sequence", "for_index", "mode", "latitude_deg", "longitude_deg", "height_m", "p_ned_m", "v_n_mps", "q_nb", "bias_f_b_mps2", "bias_omega_b_radps", "sigma", "position_covariance", "origin_latitude_deg", "origin_longitude_deg", "origin_height_m", "fix_age_s", "horizon", "alignment", "gnss_muted", "calibration", "height_reference")
    class Mode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        MODE_WAITING: _ClassVar[NavSolution.Mode]
        MODE_LEVELLING: _ClassVar[NavSolution.Mode]
        MODE_COURSE: _ClassVar[NavSolution.Mode]
        MODE_NAVIGATING: _ClassVar[NavSolution.Mode]
    MODE_WAITING: NavSolution.Mode
    MODE_LEVELLING: NavSolution.Mode
    MODE_COURSE: NavSolution.Mode
    MODE_NAVIGATING: NavSolution.Mode
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    FOR_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FOR_INDEX_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    LATITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    LONGITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    P_NED_M_FIELD_NUMBER: _ClassVar[int]
    V_N_MPS_FIELD_NUMBER: _ClassVar[int]
    Q_NB_FIELD_NUMBER: _ClassVar[int]
    BIAS_F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    BIAS_OMEGA_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    SIGMA_FIELD_NUMBER: _ClassVar[int]
    POSITION_COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_LATITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_LONGITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    FIX_AGE_S_FIELD_NUMBER: _ClassVar[int]
    HORIZON_FIELD_NUMBER: _ClassVar[int]
    ALIGNMENT_FIELD_NUMBER: _ClassVar[int]
    GNSS_MUTED_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_REFERENCE_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    for_sequence: int
    for_index: int
    mode: NavSolution.Mode
    latitude_deg: float
    longitude_deg: float
    height_m: float
    p_ned_m: _containers.RepeatedScalarFieldContainer[float]
    v_n_mps: _containers.RepeatedScalarFieldContainer[float]
    q_nb: _containers.RepeatedScalarFieldContainer[float]
    bias_f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    bias_omega_b_radps: _containers.RepeatedScalarFieldContainer[float]
    sigma: _containers.RepeatedScalarFieldContainer[float]
    position_covariance: _containers.RepeatedScalarFieldContainer[float]
    origin_latitude_deg: float
    origin_longitude_deg: float
    origin_height_m: float
    fix_age_s: float
    horizon: Horizon
    alignment: str
    gnss_muted: bool
    calibration: str
    height_reference: HeightReference
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., for_sequence: _Optional[int] = ..., for_index: _Optional[int] = ..., mode: _Optional[_Union[NavSolution.Mode, str]] = ..., latitude_deg: _Optional[float] = ..., longitude_deg: _Optional[float] = ..., height_m: _Optional[float] = ..., p_ned_m: _Optional[_Iterable[float]] = ..., v_n_mps: _Optional[_Iterable[float]] = ..., q_nb: _Optional[_Iterable[float]] = ..., bias_f_b_mps2: _Optional[_Iterable[float]] = ..., bias_omega_b_radps: _Optional[_Iterable[float]] = ..., sigma: _Optional[_Iterable[float]] = ..., position_covariance: _Optional[_Iterable[float]] = ..., origin_latitude_deg: _Optional[float] = ..., origin_longitude_deg: _Optional[float] = ..., origin_height_m: _Optional[float] = ..., fix_age_s: _Optional[float] = ..., horizon: _Optional[_Union[Horizon, _Mapping]] = ..., alignment: _Optional[str] = ..., gnss_muted: _Optional[bool] = ..., calibration: _Optional[str] = ..., height_reference: _Optional[_Union[HeightReference, str]] = ...) -> None: ...

class Innovation(_message.Message):
    __slots__ = ("header", "estimator", "for_sequence", "name", "value", "sigma", "nis", "dof", "accepted", "error_to_reference", "reason", "weight", "prediction_error", "residual")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    FOR_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    SIGMA_FIELD_NUMBER: _ClassVar[int]
    NIS_FIELD_NUMBER: _ClassVar[int]
    DOF_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    ERROR_TO_REFERENCE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    WEIGHT_FIELD_NUMBER: _ClassVar[int]
    PREDICTION_ERROR_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    for_sequence: int
    name: _containers.RepeatedScalarFieldContainer[str]
    value: _containers.RepeatedScalarFieldContainer[float]
    sigma: _containers.RepeatedScalarFieldContainer[float]
    nis: float
    dof: int
    accepted: bool
    error_to_reference: _containers.RepeatedScalarFieldContainer[float]
    reason: str
    weight: float
    prediction_error: _containers.RepeatedScalarFieldContainer[float]
    residual: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., for_sequence: _Optional[int] = ..., name: _Optional[_Iterable[str]] = ..., value: _Optional[_Iterable[float]] = ..., sigma: _Optional[_Iterable[float]] = ..., nis: _Optional[float] = ..., dof: _Optional[int] = ..., accepted: _Optional[bool] = ..., error_to_reference: _Optional[_Iterable[float]] = ..., reason: _Optional[str] = ..., weight: _Optional[float] = ..., prediction_error: _Optional[_Iterable[float]] = ..., residual: _Optional[_Iterable[float]] = ...) -> None: ...

class Truth(_message.Message):
    __slots__ = ("header", "for_index", "q_nb", "omega_ib_b_radps", "alpha_b_radps2", "f_b_mps2", "angle_z_rad", "profile_time_s")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    FOR_INDEX_FIELD_NUMBER: _ClassVar[int]
    Q_NB_FIELD_NUMBER: _ClassVar[int]
    OMEGA_IB_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    ALPHA_B_RADPS2_FIELD_NUMBER: _ClassVar[int]
    F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    ANGLE_Z_RAD_FIELD_NUMBER: _ClassVar[int]
    PROFILE_TIME_S_FIELD_NUMBER: _ClassVar[int]
    header: Header
    for_index: int
    q_nb: _containers.RepeatedScalarFieldContainer[float]
    omega_ib_b_radps: _containers.RepeatedScalarFieldContainer[float]
    alpha_b_radps2: _containers.RepeatedScalarFieldContainer[float]
    f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    angle_z_rad: float
    profile_time_s: float
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., for_index: _Optional[int] = ..., q_nb: _Optional[_Iterable[float]] = ..., omega_ib_b_radps: _Optional[_Iterable[float]] = ..., alpha_b_radps2: _Optional[_Iterable[float]] = ..., f_b_mps2: _Optional[_Iterable[float]] = ..., angle_z_rad: _Optional[float] = ..., profile_time_s: _Optional[float] = ...) -> None: ...

class EstimatorStatus(_message.Message):
    __slots__ = ("header", "estimator", "samples", "gaps", "missing_samples", "us_per_sample", "state", "message", "bias_f_b_mps2", "bias_alpha_radps2", "layout", "version", "restart", "refused", "behind_s", "waiting", "trouble", "skipped_s", "limit_hz", "began_utc_ns")
    class RefusedEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    GAPS_FIELD_NUMBER: _ClassVar[int]
    MISSING_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    US_PER_SAMPLE_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    BIAS_F_B_MPS2_FIELD_NUMBER: _ClassVar[int]
    BIAS_ALPHA_RADPS2_FIELD_NUMBER: _ClassVar[int]
    LAYOUT_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    RESTART_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    BEHIND_S_FIELD_NUMBER: _ClassVar[int]
    WAITING_FIELD_NUMBER: _ClassVar[int]
    TROUBLE_FIELD_NUMBER: _ClassVar[int]
    SKIPPED_S_FIELD_NUMBER: _ClassVar[int]
    LIMIT_HZ_FIELD_NUMBER: _ClassVar[int]
    BEGAN_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    samples: int
    gaps: int
    missing_samples: int
    us_per_sample: float
    state: str
    message: str
    bias_f_b_mps2: _containers.RepeatedScalarFieldContainer[float]
    bias_alpha_radps2: _containers.RepeatedScalarFieldContainer[float]
    layout: str
    version: str
    restart: bytes
    refused: _containers.ScalarMap[str, int]
    behind_s: float
    waiting: int
    trouble: str
    skipped_s: float
    limit_hz: float
    began_utc_ns: int
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., samples: _Optional[int] = ..., gaps: _Optional[int] = ..., missing_samples: _Optional[int] = ..., us_per_sample: _Optional[float] = ..., state: _Optional[str] = ..., message: _Optional[str] = ..., bias_f_b_mps2: _Optional[_Iterable[float]] = ..., bias_alpha_radps2: _Optional[_Iterable[float]] = ..., layout: _Optional[str] = ..., version: _Optional[str] = ..., restart: _Optional[bytes] = ..., refused: _Optional[_Mapping[str, int]] = ..., behind_s: _Optional[float] = ..., waiting: _Optional[int] = ..., trouble: _Optional[str] = ..., skipped_s: _Optional[float] = ..., limit_hz: _Optional[float] = ..., began_utc_ns: _Optional[int] = ...) -> None: ...

class Horizon(_message.Message):
    __slots__ = ("n", "inputs", "membership_name", "membership", "crisp")
    N_FIELD_NUMBER: _ClassVar[int]
    INPUTS_FIELD_NUMBER: _ClassVar[int]
    MEMBERSHIP_NAME_FIELD_NUMBER: _ClassVar[int]
    MEMBERSHIP_FIELD_NUMBER: _ClassVar[int]
    CRISP_FIELD_NUMBER: _ClassVar[int]
    n: int
    inputs: _containers.RepeatedScalarFieldContainer[float]
    membership_name: _containers.RepeatedScalarFieldContainer[str]
    membership: _containers.RepeatedScalarFieldContainer[float]
    crisp: float
    def __init__(self, n: _Optional[int] = ..., inputs: _Optional[_Iterable[float]] = ..., membership_name: _Optional[_Iterable[str]] = ..., membership: _Optional[_Iterable[float]] = ..., crisp: _Optional[float] = ...) -> None: ...

class AttitudeEstimate(_message.Message):
    __slots__ = ("header", "estimator", "for_sequence", "for_index", "q_nb", "inclination_sigma_rad", "bias_omega_b_radps", "resting", "heading_known")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ESTIMATOR_FIELD_NUMBER: _ClassVar[int]
    FOR_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FOR_INDEX_FIELD_NUMBER: _ClassVar[int]
    Q_NB_FIELD_NUMBER: _ClassVar[int]
    INCLINATION_SIGMA_RAD_FIELD_NUMBER: _ClassVar[int]
    BIAS_OMEGA_B_RADPS_FIELD_NUMBER: _ClassVar[int]
    RESTING_FIELD_NUMBER: _ClassVar[int]
    HEADING_KNOWN_FIELD_NUMBER: _ClassVar[int]
    header: Header
    estimator: str
    for_sequence: int
    for_index: int
    q_nb: _containers.RepeatedScalarFieldContainer[float]
    inclination_sigma_rad: float
    bias_omega_b_radps: _containers.RepeatedScalarFieldContainer[float]
    resting: bool
    heading_known: bool
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., estimator: _Optional[str] = ..., for_sequence: _Optional[int] = ..., for_index: _Optional[int] = ..., q_nb: _Optional[_Iterable[float]] = ..., inclination_sigma_rad: _Optional[float] = ..., bias_omega_b_radps: _Optional[_Iterable[float]] = ..., resting: _Optional[bool] = ..., heading_known: _Optional[bool] = ...) -> None: ...

class AxisHealth(_message.Message):
    __slots__ = ("header", "layout", "axes", "chi2", "dof", "message", "scale_m")
    class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STATE_GOOD: _ClassVar[AxisHealth.State]
        STATE_STUCK: _ClassVar[AxisHealth.State]
        STATE_SATURATED: _ClassVar[AxisHealth.State]
        STATE_SWAPPED: _ClassVar[AxisHealth.State]
        STATE_FLIPPED: _ClassVar[AxisHealth.State]
        STATE_SPIKING: _ClassVar[AxisHealth.State]
        STATE_BIASED: _ClassVar[AxisHealth.State]
        STATE_STALE: _ClassVar[AxisHealth.State]
        STATE_SUSPECT: _ClassVar[AxisHealth.State]
    STATE_GOOD: AxisHealth.State
    STATE_STUCK: AxisHealth.State
    STATE_SATURATED: AxisHealth.State
    STATE_SWAPPED: AxisHealth.State
    STATE_FLIPPED: AxisHealth.State
    STATE_SPIKING: AxisHealth.State
    STATE_BIASED: AxisHealth.State
    STATE_STALE: AxisHealth.State
    STATE_SUSPECT: AxisHealth.State
    class Axis(_message.Message):
        __slots__ = ("name", "state", "excluded", "residual_mps2", "residual_sigma_mps2", "since_utc_ns", "text", "position_b_m", "direction_b")
        NAME_FIELD_NUMBER: _ClassVar[int]
        STATE_FIELD_NUMBER: _ClassVar[int]
        EXCLUDED_FIELD_NUMBER: _ClassVar[int]
        RESIDUAL_MPS2_FIELD_NUMBER: _ClassVar[int]
        RESIDUAL_SIGMA_MPS2_FIELD_NUMBER: _ClassVar[int]
        SINCE_UTC_NS_FIELD_NUMBER: _ClassVar[int]
        TEXT_FIELD_NUMBER: _ClassVar[int]
        POSITION_B_M_FIELD_NUMBER: _ClassVar[int]
        DIRECTION_B_FIELD_NUMBER: _ClassVar[int]
        name: str
        state: AxisHealth.State
        excluded: bool
        residual_mps2: float
        residual_sigma_mps2: float
        since_utc_ns: int
        text: str
        position_b_m: _containers.RepeatedScalarFieldContainer[float]
        direction_b: _containers.RepeatedScalarFieldContainer[float]
        def __init__(self, name: _Optional[str] = ..., state: _Optional[_Union[AxisHealth.State, str]] = ..., excluded: _Optional[bool] = ..., residual_mps2: _Optional[float] = ..., residual_sigma_mps2: _Optional[float] = ..., since_utc_ns: _Optional[int] = ..., text: _Optional[str] = ..., position_b_m: _Optional[_Iterable[float]] = ..., direction_b: _Optional[_Iterable[float]] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    LAYOUT_FIELD_NUMBER: _ClassVar[int]
    AXES_FIELD_NUMBER: _ClassVar[int]
    CHI2_FIELD_NUMBER: _ClassVar[int]
    DOF_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    SCALE_M_FIELD_NUMBER: _ClassVar[int]
    header: Header
    layout: str
    axes: _containers.RepeatedCompositeFieldContainer[AxisHealth.Axis]
    chi2: float
    dof: int
    message: str
    scale_m: float
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., layout: _Optional[str] = ..., axes: _Optional[_Iterable[_Union[AxisHealth.Axis, _Mapping]]] = ..., chi2: _Optional[float] = ..., dof: _Optional[int] = ..., message: _Optional[str] = ..., scale_m: _Optional[float] = ...) -> None: ...

class CalibrationStatus(_message.Message):
    __slots__ = ("header", "state", "instruction", "progress", "poses", "bias_sigma_mps2", "scale_sigma", "good_enough", "residual_mps2", "card", "message", "next_up_b")
    class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STATE_IDLE: _ClassVar[CalibrationStatus.State]
        STATE_WAITING: _ClassVar[CalibrationStatus.State]
        STATE_TAKING: _ClassVar[CalibrationStatus.State]
        STATE_TURNING: _ClassVar[CalibrationStatus.State]
        STATE_FITTED: _ClassVar[CalibrationStatus.State]
        STATE_SAVED: _ClassVar[CalibrationStatus.State]
        STATE_FAILED: _ClassVar[CalibrationStatus.State]
    STATE_IDLE: CalibrationStatus.State
    STATE_WAITING: CalibrationStatus.State
    STATE_TAKING: CalibrationStatus.State
    STATE_TURNING: CalibrationStatus.State
    STATE_FITTED: CalibrationStatus.State
    STATE_SAVED: CalibrationStatus.State
    STATE_FAILED: CalibrationStatus.State
    class Pose(_message.Message):
        __slots__ = ("up_b", "samples", "scatter_mps2")
        UP_B_FIELD_NUMBER: _ClassVar[int]
        SAMPLES_FIELD_NUMBER: _ClassVar[int]
        SCATTER_MPS2_FIELD_NUMBER: _ClassVar[int]
        up_b: _containers.RepeatedScalarFieldContainer[float]
        samples: int
        scatter_mps2: float
        def __init__(self, up_b: _Optional[_Iterable[float]] = ..., samples: _Optional[int] = ..., scatter_mps2: _Optional[float] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    INSTRUCTION_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_FIELD_NUMBER: _ClassVar[int]
    POSES_FIELD_NUMBER: _ClassVar[int]
    BIAS_SIGMA_MPS2_FIELD_NUMBER: _ClassVar[int]
    SCALE_SIGMA_FIELD_NUMBER: _ClassVar[int]
    GOOD_ENOUGH_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_MPS2_FIELD_NUMBER: _ClassVar[int]
    CARD_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    NEXT_UP_B_FIELD_NUMBER: _ClassVar[int]
    header: Header
    state: CalibrationStatus.State
    instruction: str
    progress: float
    poses: _containers.RepeatedCompositeFieldContainer[CalibrationStatus.Pose]
    bias_sigma_mps2: _containers.RepeatedScalarFieldContainer[float]
    scale_sigma: _containers.RepeatedScalarFieldContainer[float]
    good_enough: bool
    residual_mps2: float
    card: str
    message: str
    next_up_b: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., state: _Optional[_Union[CalibrationStatus.State, str]] = ..., instruction: _Optional[str] = ..., progress: _Optional[float] = ..., poses: _Optional[_Iterable[_Union[CalibrationStatus.Pose, _Mapping]]] = ..., bias_sigma_mps2: _Optional[_Iterable[float]] = ..., scale_sigma: _Optional[_Iterable[float]] = ..., good_enough: _Optional[bool] = ..., residual_mps2: _Optional[float] = ..., card: _Optional[str] = ..., message: _Optional[str] = ..., next_up_b: _Optional[_Iterable[float]] = ...) -> None: ...

class EstimatorCommand(_message.Message):
    __slots__ = ("action", "device", "seconds", "card", "user")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_NONE: _ClassVar[EstimatorCommand.Action]
        ACTION_MUTE_GNSS: _ClassVar[EstimatorCommand.Action]
        ACTION_CALIBRATE_START: _ClassVar[EstimatorCommand.Action]
        ACTION_CALIBRATE_FIT: _ClassVar[EstimatorCommand.Action]
        ACTION_CALIBRATE_SAVE: _ClassVar[EstimatorCommand.Action]
        ACTION_CALIBRATE_CANCEL: _ClassVar[EstimatorCommand.Action]
        ACTION_USE_CARD: _ClassVar[EstimatorCommand.Action]
        ACTION_WIRING_START: _ClassVar[EstimatorCommand.Action]
        ACTION_WIRING_SAVE: _ClassVar[EstimatorCommand.Action]
        ACTION_WIRING_CANCEL: _ClassVar[EstimatorCommand.Action]
        ACTION_USE_MAP: _ClassVar[EstimatorCommand.Action]
    ACTION_NONE: EstimatorCommand.Action
    ACTION_MUTE_GNSS: EstimatorCommand.Action
    ACTION_CALIBRATE_START: EstimatorCommand.Action
    ACTION_CALIBRATE_FIT: EstimatorCommand.Action
    ACTION_CALIBRATE_SAVE: EstimatorCommand.Action
    ACTION_CALIBRATE_CANCEL: EstimatorCommand.Action
    ACTION_USE_CARD: EstimatorCommand.Action
    ACTION_WIRING_START: EstimatorCommand.Action
    ACTION_WIRING_SAVE: EstimatorCommand.Action
    ACTION_WIRING_CANCEL: EstimatorCommand.Action
    ACTION_USE_MAP: EstimatorCommand.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    CARD_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    action: EstimatorCommand.Action
    device: str
    seconds: float
    card: str
    user: str
    def __init__(self, action: _Optional[_Union[EstimatorCommand.Action, str]] = ..., device: _Optional[str] = ..., seconds: _Optional[float] = ..., card: _Optional[str] = ..., user: _Optional[str] = ...) -> None: ...

class WiringStatus(_message.Message):
    __slots__ = ("header", "state", "instruction", "progress", "message", "source", "inputs", "turns", "complete", "map", "pose")
    class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STATE_IDLE: _ClassVar[WiringStatus.State]
        STATE_WAITING: _ClassVar[WiringStatus.State]
        STATE_MOVING: _ClassVar[WiringStatus.State]
        STATE_FOUND: _ClassVar[WiringStatus.State]
        STATE_SAVED: _ClassVar[WiringStatus.State]
    STATE_IDLE: WiringStatus.State
    STATE_WAITING: WiringStatus.State
    STATE_MOVING: WiringStatus.State
    STATE_FOUND: WiringStatus.State
    STATE_SAVED: WiringStatus.State
    class Pose(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        POSE_LEVEL: _ClassVar[WiringStatus.Pose]
        POSE_NOSE_UP: _ClassVar[WiringStatus.Pose]
        POSE_RIGHT_DOWN: _ClassVar[WiringStatus.Pose]
        POSE_TURNED_RIGHT: _ClassVar[WiringStatus.Pose]
    POSE_LEVEL: WiringStatus.Pose
    POSE_NOSE_UP: WiringStatus.Pose
    POSE_RIGHT_DOWN: WiringStatus.Pose
    POSE_TURNED_RIGHT: WiringStatus.Pose
    class Input(_message.Message):
        __slots__ = ("name", "reading", "unit", "axis", "inverted", "unused")
        NAME_FIELD_NUMBER: _ClassVar[int]
        READING_FIELD_NUMBER: _ClassVar[int]
        UNIT_FIELD_NUMBER: _ClassVar[int]
        AXIS_FIELD_NUMBER: _ClassVar[int]
        INVERTED_FIELD_NUMBER: _ClassVar[int]
        UNUSED_FIELD_NUMBER: _ClassVar[int]
        name: str
        reading: float
        unit: str
        axis: str
        inverted: bool
        unused: bool
        def __init__(self, name: _Optional[str] = ..., reading: _Optional[float] = ..., unit: _Optional[str] = ..., axis: _Optional[str] = ..., inverted: _Optional[bool] = ..., unused: _Optional[bool] = ...) -> None: ...
    class Turn(_message.Message):
        __slots__ = ("about", "by_force_rad", "by_rate_rad")
        ABOUT_FIELD_NUMBER: _ClassVar[int]
        BY_FORCE_RAD_FIELD_NUMBER: _ClassVar[int]
        BY_RATE_RAD_FIELD_NUMBER: _ClassVar[int]
        about: str
        by_force_rad: float
        by_rate_rad: float
        def __init__(self, about: _Optional[str] = ..., by_force_rad: _Optional[float] = ..., by_rate_rad: _Optional[float] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    INSTRUCTION_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    INPUTS_FIELD_NUMBER: _ClassVar[int]
    TURNS_FIELD_NUMBER: _ClassVar[int]
    COMPLETE_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    header: Header
    state: WiringStatus.State
    instruction: str
    progress: float
    message: str
    source: str
    inputs: _containers.RepeatedCompositeFieldContainer[WiringStatus.Input]
    turns: _containers.RepeatedCompositeFieldContainer[WiringStatus.Turn]
    complete: bool
    map: str
    pose: WiringStatus.Pose
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., state: _Optional[_Union[WiringStatus.State, str]] = ..., instruction: _Optional[str] = ..., progress: _Optional[float] = ..., message: _Optional[str] = ..., source: _Optional[str] = ..., inputs: _Optional[_Iterable[_Union[WiringStatus.Input, _Mapping]]] = ..., turns: _Optional[_Iterable[_Union[WiringStatus.Turn, _Mapping]]] = ..., complete: _Optional[bool] = ..., map: _Optional[str] = ..., pose: _Optional[_Union[WiringStatus.Pose, str]] = ...) -> None: ...

class BoardCommand(_message.Message):
    __slots__ = ("name", "value", "user", "ask")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    ASK_FIELD_NUMBER: _ClassVar[int]
    name: str
    value: int
    user: str
    ask: bool
    def __init__(self, name: _Optional[str] = ..., value: _Optional[int] = ..., user: _Optional[str] = ..., ask: _Optional[bool] = ...) -> None: ...

class Reply(_message.Message):
    __slots__ = ("ok", "message")
    OK_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    ok: bool
    message: str
    def __init__(self, ok: _Optional[bool] = ..., message: _Optional[str] = ...) -> None: ...

class Seat(_message.Message):
    __slots__ = ("id", "user", "place", "admin", "service")
    ID_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    PLACE_FIELD_NUMBER: _ClassVar[int]
    ADMIN_FIELD_NUMBER: _ClassVar[int]
    SERVICE_FIELD_NUMBER: _ClassVar[int]
    id: str
    user: str
    place: str
    admin: bool
    service: bool
    def __init__(self, id: _Optional[str] = ..., user: _Optional[str] = ..., place: _Optional[str] = ..., admin: _Optional[bool] = ..., service: _Optional[bool] = ...) -> None: ...

class OrderBy(_message.Message):
    __slots__ = ("seat", "epoch")
    SEAT_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    seat: Seat
    epoch: int
    def __init__(self, seat: _Optional[_Union[Seat, _Mapping]] = ..., epoch: _Optional[int] = ...) -> None: ...

class CommandStatus(_message.Message):
    __slots__ = ("header", "epoch", "holder", "since_utc_ns", "asks", "left_s", "answer_s", "away_s", "last")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    HOLDER_FIELD_NUMBER: _ClassVar[int]
    SINCE_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    ASKS_FIELD_NUMBER: _ClassVar[int]
    LEFT_S_FIELD_NUMBER: _ClassVar[int]
    ANSWER_S_FIELD_NUMBER: _ClassVar[int]
    AWAY_S_FIELD_NUMBER: _ClassVar[int]
    LAST_FIELD_NUMBER: _ClassVar[int]
    header: Header
    epoch: int
    holder: Seat
    since_utc_ns: int
    asks: Seat
    left_s: float
    answer_s: float
    away_s: float
    last: str
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., epoch: _Optional[int] = ..., holder: _Optional[_Union[Seat, _Mapping]] = ..., since_utc_ns: _Optional[int] = ..., asks: _Optional[_Union[Seat, _Mapping]] = ..., left_s: _Optional[float] = ..., answer_s: _Optional[float] = ..., away_s: _Optional[float] = ..., last: _Optional[str] = ...) -> None: ...

class OrderGiven(_message.Message):
    __slots__ = ("header", "at_utc_ns", "user", "place", "whom", "device", "what", "outcome", "text", "seconds")
    class Outcome(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        OUTCOME_NONE: _ClassVar[OrderGiven.Outcome]
        OUTCOME_DONE: _ClassVar[OrderGiven.Outcome]
        OUTCOME_REFUSED: _ClassVar[OrderGiven.Outcome]
        OUTCOME_NO_ANSWER: _ClassVar[OrderGiven.Outcome]
    OUTCOME_NONE: OrderGiven.Outcome
    OUTCOME_DONE: OrderGiven.Outcome
    OUTCOME_REFUSED: OrderGiven.Outcome
    OUTCOME_NO_ANSWER: OrderGiven.Outcome
    HEADER_FIELD_NUMBER: _ClassVar[int]
    AT_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    PLACE_FIELD_NUMBER: _ClassVar[int]
    WHOM_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    WHAT_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    at_utc_ns: int
    user: str
    place: str
    whom: str
    device: str
    what: str
    outcome: OrderGiven.Outcome
    text: str
    seconds: float
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., at_utc_ns: _Optional[int] = ..., user: _Optional[str] = ..., place: _Optional[str] = ..., whom: _Optional[str] = ..., device: _Optional[str] = ..., what: _Optional[str] = ..., outcome: _Optional[_Union[OrderGiven.Outcome, str]] = ..., text: _Optional[str] = ..., seconds: _Optional[float] = ...) -> None: ...

class SeatCommand(_message.Message):
    __slots__ = ("action", "seat", "text", "most", "to")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_LOOK: _ClassVar[SeatCommand.Action]
        ACTION_TAKE: _ClassVar[SeatCommand.Action]
        ACTION_ASK: _ClassVar[SeatCommand.Action]
        ACTION_GRANT: _ClassVar[SeatCommand.Action]
        ACTION_DENY: _ClassVar[SeatCommand.Action]
        ACTION_RELEASE: _ClassVar[SeatCommand.Action]
        ACTION_KEEP: _ClassVar[SeatCommand.Action]
        ACTION_FORCE: _ClassVar[SeatCommand.Action]
    ACTION_LOOK: SeatCommand.Action
    ACTION_TAKE: SeatCommand.Action
    ACTION_ASK: SeatCommand.Action
    ACTION_GRANT: SeatCommand.Action
    ACTION_DENY: SeatCommand.Action
    ACTION_RELEASE: SeatCommand.Action
    ACTION_KEEP: SeatCommand.Action
    ACTION_FORCE: SeatCommand.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    SEAT_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    MOST_FIELD_NUMBER: _ClassVar[int]
    TO_FIELD_NUMBER: _ClassVar[int]
    action: SeatCommand.Action
    seat: Seat
    text: str
    most: int
    to: Seat
    def __init__(self, action: _Optional[_Union[SeatCommand.Action, str]] = ..., seat: _Optional[_Union[Seat, _Mapping]] = ..., text: _Optional[str] = ..., most: _Optional[int] = ..., to: _Optional[_Union[Seat, _Mapping]] = ...) -> None: ...

class SeatReply(_message.Message):
    __slots__ = ("ok", "message", "status", "history", "lost")
    OK_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    HISTORY_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    ok: bool
    message: str
    status: CommandStatus
    history: _containers.RepeatedCompositeFieldContainer[OrderGiven]
    lost: int
    def __init__(self, ok: _Optional[bool] = ..., message: _Optional[str] = ..., status: _Optional[_Union[CommandStatus, _Mapping]] = ..., history: _Optional[_Iterable[_Union[OrderGiven, _Mapping]]] = ..., lost: _Optional[int] = ...) -> None: ...

class Note(_message.Message):
    __slots__ = ("header", "text", "author", "kind", "at_utc_ns", "seconds")
    class Kind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        KIND_NOTE: _ClassVar[Note.Kind]
        KIND_MARK: _ClassVar[Note.Kind]
        KIND_EVENT: _ClassVar[Note.Kind]
    KIND_NOTE: Note.Kind
    KIND_MARK: Note.Kind
    KIND_EVENT: Note.Kind
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    AUTHOR_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    AT_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    text: str
    author: str
    kind: Note.Kind
    at_utc_ns: int
    seconds: float
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., text: _Optional[str] = ..., author: _Optional[str] = ..., kind: _Optional[_Union[Note.Kind, str]] = ..., at_utc_ns: _Optional[int] = ..., seconds: _Optional[float] = ...) -> None: ...

class ReplayCommand(_message.Message):
    __slots__ = ("action", "value", "until", "user")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_STATUS: _ClassVar[ReplayCommand.Action]
        ACTION_PAUSE: _ClassVar[ReplayCommand.Action]
        ACTION_RESUME: _ClassVar[ReplayCommand.Action]
        ACTION_SEEK: _ClassVar[ReplayCommand.Action]
        ACTION_SPEED: _ClassVar[ReplayCommand.Action]
        ACTION_STEP: _ClassVar[ReplayCommand.Action]
        ACTION_LOOP: _ClassVar[ReplayCommand.Action]
        ACTION_END: _ClassVar[ReplayCommand.Action]
    ACTION_STATUS: ReplayCommand.Action
    ACTION_PAUSE: ReplayCommand.Action
    ACTION_RESUME: ReplayCommand.Action
    ACTION_SEEK: ReplayCommand.Action
    ACTION_SPEED: ReplayCommand.Action
    ACTION_STEP: ReplayCommand.Action
    ACTION_LOOP: ReplayCommand.Action
    ACTION_END: ReplayCommand.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    UNTIL_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    action: ReplayCommand.Action
    value: float
    until: float
    user: str
    def __init__(self, action: _Optional[_Union[ReplayCommand.Action, str]] = ..., value: _Optional[float] = ..., until: _Optional[float] = ..., user: _Optional[str] = ...) -> None: ...

class ReplayStatus(_message.Message):
    __slots__ = ("header", "session", "position_s", "length_s", "speed", "paused", "loop_from_s", "loop_until_s", "message")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    POSITION_S_FIELD_NUMBER: _ClassVar[int]
    LENGTH_S_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    PAUSED_FIELD_NUMBER: _ClassVar[int]
    LOOP_FROM_S_FIELD_NUMBER: _ClassVar[int]
    LOOP_UNTIL_S_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    header: Header
    session: str
    position_s: float
    length_s: float
    speed: float
    paused: bool
    loop_from_s: float
    loop_until_s: float
    message: str
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., session: _Optional[str] = ..., position_s: _Optional[float] = ..., length_s: _Optional[float] = ..., speed: _Optional[float] = ..., paused: _Optional[bool] = ..., loop_from_s: _Optional[float] = ..., loop_until_s: _Optional[float] = ..., message: _Optional[str] = ...) -> None: ...

class RecorderCommand(_message.Message):
    __slots__ = ("action", "name", "note", "user")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_STATUS: _ClassVar[RecorderCommand.Action]
        ACTION_START: _ClassVar[RecorderCommand.Action]
        ACTION_STOP: _ClassVar[RecorderCommand.Action]
    ACTION_STATUS: RecorderCommand.Action
    ACTION_START: RecorderCommand.Action
    ACTION_STOP: RecorderCommand.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NOTE_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    action: RecorderCommand.Action
    name: str
    note: str
    user: str
    def __init__(self, action: _Optional[_Union[RecorderCommand.Action, str]] = ..., name: _Optional[str] = ..., note: _Optional[str] = ..., user: _Optional[str] = ...) -> None: ...

class RecorderStatus(_message.Message):
    __slots__ = ("header", "recording", "session", "seconds", "messages", "bytes", "durable_messages", "message", "lost", "repaired", "repairing", "refused", "clock_steps", "clock_offset_s", "continues")
    class LostEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    class RepairedEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    class RefusedEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: int
        def __init__(self, key: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    RECORDING_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    MESSAGES_FIELD_NUMBER: _ClassVar[int]
    BYTES_FIELD_NUMBER: _ClassVar[int]
    DURABLE_MESSAGES_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    REPAIRED_FIELD_NUMBER: _ClassVar[int]
    REPAIRING_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    CLOCK_STEPS_FIELD_NUMBER: _ClassVar[int]
    CLOCK_OFFSET_S_FIELD_NUMBER: _ClassVar[int]
    CONTINUES_FIELD_NUMBER: _ClassVar[int]
    header: Header
    recording: bool
    session: str
    seconds: float
    messages: int
    bytes: int
    durable_messages: int
    message: str
    lost: _containers.ScalarMap[str, int]
    repaired: _containers.ScalarMap[str, int]
    repairing: int
    refused: _containers.ScalarMap[str, int]
    clock_steps: int
    clock_offset_s: float
    continues: str
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., recording: _Optional[bool] = ..., session: _Optional[str] = ..., seconds: _Optional[float] = ..., messages: _Optional[int] = ..., bytes: _Optional[int] = ..., durable_messages: _Optional[int] = ..., message: _Optional[str] = ..., lost: _Optional[_Mapping[str, int]] = ..., repaired: _Optional[_Mapping[str, int]] = ..., repairing: _Optional[int] = ..., refused: _Optional[_Mapping[str, int]] = ..., clock_steps: _Optional[int] = ..., clock_offset_s: _Optional[float] = ..., continues: _Optional[str] = ...) -> None: ...

class HistoryQuery(_message.Message):
    __slots__ = ("topics", "of", "after_run", "after_sequence", "until_run", "until_sequence", "from_utc_ns", "until_utc_ns", "position", "max_bytes", "until_of", "every_s")
    TOPICS_FIELD_NUMBER: _ClassVar[int]
    OF_FIELD_NUMBER: _ClassVar[int]
    AFTER_RUN_FIELD_NUMBER: _ClassVar[int]
    AFTER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UNTIL_RUN_FIELD_NUMBER: _ClassVar[int]
    UNTIL_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FROM_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    UNTIL_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    MAX_BYTES_FIELD_NUMBER: _ClassVar[int]
    UNTIL_OF_FIELD_NUMBER: _ClassVar[int]
    EVERY_S_FIELD_NUMBER: _ClassVar[int]
    topics: _containers.RepeatedScalarFieldContainer[str]
    of: str
    after_run: int
    after_sequence: int
    until_run: int
    until_sequence: int
    from_utc_ns: int
    until_utc_ns: int
    position: int
    max_bytes: int
    until_of: str
    every_s: float
    def __init__(self, topics: _Optional[_Iterable[str]] = ..., of: _Optional[str] = ..., after_run: _Optional[int] = ..., after_sequence: _Optional[int] = ..., until_run: _Optional[int] = ..., until_sequence: _Optional[int] = ..., from_utc_ns: _Optional[int] = ..., until_utc_ns: _Optional[int] = ..., position: _Optional[int] = ..., max_bytes: _Optional[int] = ..., until_of: _Optional[str] = ..., every_s: _Optional[float] = ...) -> None: ...

class HistoryReply(_message.Message):
    __slots__ = ("items", "next", "durable", "first_kept")
    ITEMS_FIELD_NUMBER: _ClassVar[int]
    NEXT_FIELD_NUMBER: _ClassVar[int]
    DURABLE_FIELD_NUMBER: _ClassVar[int]
    FIRST_KEPT_FIELD_NUMBER: _ClassVar[int]
    items: _containers.RepeatedCompositeFieldContainer[HistoryItem]
    next: int
    durable: int
    first_kept: int
    def __init__(self, items: _Optional[_Iterable[_Union[HistoryItem, _Mapping]]] = ..., next: _Optional[int] = ..., durable: _Optional[int] = ..., first_kept: _Optional[int] = ...) -> None: ...

class HistoryItem(_message.Message):
    __slots__ = ("topic", "run", "sequence", "utc_ns", "published_ns", "payload")
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    RUN_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UTC_NS_FIELD_NUMBER: _ClassVar[int]
    PUBLISHED_NS_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_FIELD_NUMBER: _ClassVar[int]
    topic: str
    run: int
    sequence: int
    utc_ns: int
    published_ns: int
    payload: bytes
    def __init__(self, topic: _Optional[str] = ..., run: _Optional[int] = ..., sequence: _Optional[int] = ..., utc_ns: _Optional[int] = ..., published_ns: _Optional[int] = ..., payload: _Optional[bytes] = ...) -> None: ...

class GnssMute(_message.Message):
    __slots__ = ("header", "after_s", "until_s", "user")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    AFTER_S_FIELD_NUMBER: _ClassVar[int]
    UNTIL_S_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    header: Header
    after_s: float
    until_s: float
    user: str
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., after_s: _Optional[float] = ..., until_s: _Optional[float] = ..., user: _Optional[str] = ...) -> None: ...

class ProcedureCommand(_message.Message):
    __slots__ = ("action", "device", "procedure", "unit", "user", "text", "own_session", "run", "step")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_NONE: _ClassVar[ProcedureCommand.Action]
        ACTION_START: _ClassVar[ProcedureCommand.Action]
        ACTION_NEXT: _ClassVar[ProcedureCommand.Action]
        ACTION_REPEAT: _ClassVar[ProcedureCommand.Action]
        ACTION_ABORT: _ClassVar[ProcedureCommand.Action]
        ACTION_STOP: _ClassVar[ProcedureCommand.Action]
    ACTION_NONE: ProcedureCommand.Action
    ACTION_START: ProcedureCommand.Action
    ACTION_NEXT: ProcedureCommand.Action
    ACTION_REPEAT: ProcedureCommand.Action
    ACTION_ABORT: ProcedureCommand.Action
    ACTION_STOP: ProcedureCommand.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    PROCEDURE_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    OWN_SESSION_FIELD_NUMBER: _ClassVar[int]
    RUN_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    action: ProcedureCommand.Action
    device: str
    procedure: str
    unit: str
    user: str
    text: str
    own_session: bool
    run: str
    step: int
    def __init__(self, action: _Optional[_Union[ProcedureCommand.Action, str]] = ..., device: _Optional[str] = ..., procedure: _Optional[str] = ..., unit: _Optional[str] = ..., user: _Optional[str] = ..., text: _Optional[str] = ..., own_session: _Optional[bool] = ..., run: _Optional[str] = ..., step: _Optional[int] = ...) -> None: ...

class ProcedureStatus(_message.Message):
    __slots__ = ("header", "state", "run", "procedure", "title", "sha256", "toml", "unit", "operator", "session", "step", "instruction", "progress", "message", "steps", "table", "table_radps", "offered", "started_utc_ns", "up_b", "reference", "alarm", "if_lost", "offers")
    class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STATE_IDLE: _ClassVar[ProcedureStatus.State]
        STATE_RUNNING: _ClassVar[ProcedureStatus.State]
        STATE_HELD: _ClassVar[ProcedureStatus.State]
        STATE_DONE: _ClassVar[ProcedureStatus.State]
        STATE_ABORTED: _ClassVar[ProcedureStatus.State]
        STATE_STOPPED: _ClassVar[ProcedureStatus.State]
    STATE_IDLE: ProcedureStatus.State
    STATE_RUNNING: ProcedureStatus.State
    STATE_HELD: ProcedureStatus.State
    STATE_DONE: ProcedureStatus.State
    STATE_ABORTED: ProcedureStatus.State
    STATE_STOPPED: ProcedureStatus.State
    class Offer(_message.Message):
        __slots__ = ("name", "title", "top_radps", "seconds", "steps", "fault")
        NAME_FIELD_NUMBER: _ClassVar[int]
        TITLE_FIELD_NUMBER: _ClassVar[int]
        TOP_RADPS_FIELD_NUMBER: _ClassVar[int]
        SECONDS_FIELD_NUMBER: _ClassVar[int]
        STEPS_FIELD_NUMBER: _ClassVar[int]
        FAULT_FIELD_NUMBER: _ClassVar[int]
        name: str
        title: str
        top_radps: float
        seconds: float
        steps: int
        fault: str
        def __init__(self, name: _Optional[str] = ..., title: _Optional[str] = ..., top_radps: _Optional[float] = ..., seconds: _Optional[float] = ..., steps: _Optional[int] = ..., fault: _Optional[str] = ...) -> None: ...
    class Step(_message.Message):
        __slots__ = ("name", "kind", "target_radps", "dwell_s", "state", "reason", "attempts", "epoch", "from_us", "until_us", "from_utc_ns", "until_utc_ns", "figures", "spoilt", "confirmed_by", "trouble")
        class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
            __slots__ = ()
            STATE_TODO: _ClassVar[ProcedureStatus.Step.State]
            STATE_WAITING: _ClassVar[ProcedureStatus.Step.State]
            STATE_RAMP: _ClassVar[ProcedureStatus.Step.State]
            STATE_SETTLED: _ClassVar[ProcedureStatus.Step.State]
            STATE_DWELL: _ClassVar[ProcedureStatus.Step.State]
            STATE_DONE: _ClassVar[ProcedureStatus.Step.State]
            STATE_FAILED: _ClassVar[ProcedureStatus.Step.State]
            STATE_SKIPPED: _ClassVar[ProcedureStatus.Step.State]
        STATE_TODO: ProcedureStatus.Step.State
        STATE_WAITING: ProcedureStatus.Step.State
        STATE_RAMP: ProcedureStatus.Step.State
        STATE_SETTLED: ProcedureStatus.Step.State
        STATE_DWELL: ProcedureStatus.Step.State
        STATE_DONE: ProcedureStatus.Step.State
        STATE_FAILED: ProcedureStatus.Step.State
        STATE_SKIPPED: ProcedureStatus.Step.State
        NAME_FIELD_NUMBER: _ClassVar[int]
        KIND_FIELD_NUMBER: _ClassVar[int]
        TARGET_RADPS_FIELD_NUMBER: _ClassVar[int]
        DWELL_S_FIELD_NUMBER: _ClassVar[int]
        STATE_FIELD_NUMBER: _ClassVar[int]
        REASON_FIELD_NUMBER: _ClassVar[int]
        ATTEMPTS_FIELD_NUMBER: _ClassVar[int]
        EPOCH_FIELD_NUMBER: _ClassVar[int]
        FROM_US_FIELD_NUMBER: _ClassVar[int]
        UNTIL_US_FIELD_NUMBER: _ClassVar[int]
        FROM_UTC_NS_FIELD_NUMBER: _ClassVar[int]
        UNTIL_UTC_NS_FIELD_NUMBER: _ClassVar[int]
        FIGURES_FIELD_NUMBER: _ClassVar[int]
        SPOILT_FIELD_NUMBER: _ClassVar[int]
        CONFIRMED_BY_FIELD_NUMBER: _ClassVar[int]
        TROUBLE_FIELD_NUMBER: _ClassVar[int]
        name: str
        kind: str
        target_radps: float
        dwell_s: float
        state: ProcedureStatus.Step.State
        reason: str
        attempts: int
        epoch: int
        from_us: int
        until_us: int
        from_utc_ns: int
        until_utc_ns: int
        figures: _containers.RepeatedCompositeFieldContainer[ProcedureStatus.Figure]
        spoilt: int
        confirmed_by: str
        trouble: _containers.RepeatedScalarFieldContainer[str]
        def __init__(self, name: _Optional[str] = ..., kind: _Optional[str] = ..., target_radps: _Optional[float] = ..., dwell_s: _Optional[float] = ..., state: _Optional[_Union[ProcedureStatus.Step.State, str]] = ..., reason: _Optional[str] = ..., attempts: _Optional[int] = ..., epoch: _Optional[int] = ..., from_us: _Optional[int] = ..., until_us: _Optional[int] = ..., from_utc_ns: _Optional[int] = ..., until_utc_ns: _Optional[int] = ..., figures: _Optional[_Iterable[_Union[ProcedureStatus.Figure, _Mapping]]] = ..., spoilt: _Optional[int] = ..., confirmed_by: _Optional[str] = ..., trouble: _Optional[_Iterable[str]] = ...) -> None: ...
    class Figure(_message.Message):
        __slots__ = ("name", "value", "sigma", "min", "max")
        NAME_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        SIGMA_FIELD_NUMBER: _ClassVar[int]
        MIN_FIELD_NUMBER: _ClassVar[int]
        MAX_FIELD_NUMBER: _ClassVar[int]
        name: str
        value: float
        sigma: float
        min: float
        max: float
        def __init__(self, name: _Optional[str] = ..., value: _Optional[float] = ..., sigma: _Optional[float] = ..., min: _Optional[float] = ..., max: _Optional[float] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    RUN_FIELD_NUMBER: _ClassVar[int]
    PROCEDURE_FIELD_NUMBER: _ClassVar[int]
    TITLE_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    TOML_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    OPERATOR_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    INSTRUCTION_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    STEPS_FIELD_NUMBER: _ClassVar[int]
    TABLE_FIELD_NUMBER: _ClassVar[int]
    TABLE_RADPS_FIELD_NUMBER: _ClassVar[int]
    OFFERED_FIELD_NUMBER: _ClassVar[int]
    STARTED_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    UP_B_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_FIELD_NUMBER: _ClassVar[int]
    ALARM_FIELD_NUMBER: _ClassVar[int]
    IF_LOST_FIELD_NUMBER: _ClassVar[int]
    OFFERS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    state: ProcedureStatus.State
    run: str
    procedure: str
    title: str
    sha256: str
    toml: str
    unit: str
    operator: str
    session: str
    step: int
    instruction: str
    progress: float
    message: str
    steps: _containers.RepeatedCompositeFieldContainer[ProcedureStatus.Step]
    table: str
    table_radps: float
    offered: _containers.RepeatedScalarFieldContainer[str]
    started_utc_ns: int
    up_b: _containers.RepeatedScalarFieldContainer[float]
    reference: _containers.RepeatedScalarFieldContainer[str]
    alarm: str
    if_lost: str
    offers: _containers.RepeatedCompositeFieldContainer[ProcedureStatus.Offer]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., state: _Optional[_Union[ProcedureStatus.State, str]] = ..., run: _Optional[str] = ..., procedure: _Optional[str] = ..., title: _Optional[str] = ..., sha256: _Optional[str] = ..., toml: _Optional[str] = ..., unit: _Optional[str] = ..., operator: _Optional[str] = ..., session: _Optional[str] = ..., step: _Optional[int] = ..., instruction: _Optional[str] = ..., progress: _Optional[float] = ..., message: _Optional[str] = ..., steps: _Optional[_Iterable[_Union[ProcedureStatus.Step, _Mapping]]] = ..., table: _Optional[str] = ..., table_radps: _Optional[float] = ..., offered: _Optional[_Iterable[str]] = ..., started_utc_ns: _Optional[int] = ..., up_b: _Optional[_Iterable[float]] = ..., reference: _Optional[_Iterable[str]] = ..., alarm: _Optional[str] = ..., if_lost: _Optional[str] = ..., offers: _Optional[_Iterable[_Union[ProcedureStatus.Offer, _Mapping]]] = ...) -> None: ...

class Alarm(_message.Message):
    __slots__ = ("id", "device", "kind", "title", "text", "page", "level", "state", "active", "unknown", "value", "limit", "unit", "raised_utc_ns", "returned_utc_ns", "acknowledged_by", "acknowledged_utc_ns", "note", "shelved_by", "shelved_s", "reason", "times", "chattering", "first_out")
    class Level(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        LEVEL_NONE: _ClassVar[Alarm.Level]
        LEVEL_WATCH: _ClassVar[Alarm.Level]
        LEVEL_WARNING: _ClassVar[Alarm.Level]
        LEVEL_CRITICAL: _ClassVar[Alarm.Level]
    LEVEL_NONE: Alarm.Level
    LEVEL_WATCH: Alarm.Level
    LEVEL_WARNING: Alarm.Level
    LEVEL_CRITICAL: Alarm.Level
    class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STATE_NORMAL: _ClassVar[Alarm.State]
        STATE_UNACKNOWLEDGED: _ClassVar[Alarm.State]
        STATE_ACKNOWLEDGED: _ClassVar[Alarm.State]
        STATE_RETURNED: _ClassVar[Alarm.State]
        STATE_SHELVED: _ClassVar[Alarm.State]
    STATE_NORMAL: Alarm.State
    STATE_UNACKNOWLEDGED: Alarm.State
    STATE_ACKNOWLEDGED: Alarm.State
    STATE_RETURNED: Alarm.State
    STATE_SHELVED: Alarm.State
    ID_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    TITLE_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    PAGE_FIELD_NUMBER: _ClassVar[int]
    LEVEL_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    ACTIVE_FIELD_NUMBER: _ClassVar[int]
    UNKNOWN_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    RAISED_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    RETURNED_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    ACKNOWLEDGED_BY_FIELD_NUMBER: _ClassVar[int]
    ACKNOWLEDGED_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    NOTE_FIELD_NUMBER: _ClassVar[int]
    SHELVED_BY_FIELD_NUMBER: _ClassVar[int]
    SHELVED_S_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    CHATTERING_FIELD_NUMBER: _ClassVar[int]
    FIRST_OUT_FIELD_NUMBER: _ClassVar[int]
    id: str
    device: str
    kind: str
    title: str
    text: str
    page: str
    level: Alarm.Level
    state: Alarm.State
    active: bool
    unknown: bool
    value: float
    limit: float
    unit: str
    raised_utc_ns: int
    returned_utc_ns: int
    acknowledged_by: str
    acknowledged_utc_ns: int
    note: str
    shelved_by: str
    shelved_s: float
    reason: str
    times: int
    chattering: bool
    first_out: bool
    def __init__(self, id: _Optional[str] = ..., device: _Optional[str] = ..., kind: _Optional[str] = ..., title: _Optional[str] = ..., text: _Optional[str] = ..., page: _Optional[str] = ..., level: _Optional[_Union[Alarm.Level, str]] = ..., state: _Optional[_Union[Alarm.State, str]] = ..., active: _Optional[bool] = ..., unknown: _Optional[bool] = ..., value: _Optional[float] = ..., limit: _Optional[float] = ..., unit: _Optional[str] = ..., raised_utc_ns: _Optional[int] = ..., returned_utc_ns: _Optional[int] = ..., acknowledged_by: _Optional[str] = ..., acknowledged_utc_ns: _Optional[int] = ..., note: _Optional[str] = ..., shelved_by: _Optional[str] = ..., shelved_s: _Optional[float] = ..., reason: _Optional[str] = ..., times: _Optional[int] = ..., chattering: _Optional[bool] = ..., first_out: _Optional[bool] = ...) -> None: ...

class AlarmStatus(_message.Message):
    __slots__ = ("header", "alarms")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ALARMS_FIELD_NUMBER: _ClassVar[int]
    header: Header
    alarms: _containers.RepeatedCompositeFieldContainer[Alarm]
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., alarms: _Optional[_Iterable[_Union[Alarm, _Mapping]]] = ...) -> None: ...

class AlarmLimit(_message.Message):
    __slots__ = ("name", "field", "device", "above", "below", "dead_band", "on_delay_s", "off_delay_s", "level", "unknown", "unit", "fixed", "user", "readings")
    class Reading(_message.Message):
        __slots__ = ("device", "value", "unit", "said")
        DEVICE_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        UNIT_FIELD_NUMBER: _ClassVar[int]
        SAID_FIELD_NUMBER: _ClassVar[int]
        device: str
        value: float
        unit: str
        said: str
        def __init__(self, device: _Optional[str] = ..., value: _Optional[float] = ..., unit: _Optional[str] = ..., said: _Optional[str] = ...) -> None: ...
    NAME_FIELD_NUMBER: _ClassVar[int]
    FIELD_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    ABOVE_FIELD_NUMBER: _ClassVar[int]
    BELOW_FIELD_NUMBER: _ClassVar[int]
    DEAD_BAND_FIELD_NUMBER: _ClassVar[int]
    ON_DELAY_S_FIELD_NUMBER: _ClassVar[int]
    OFF_DELAY_S_FIELD_NUMBER: _ClassVar[int]
    LEVEL_FIELD_NUMBER: _ClassVar[int]
    UNKNOWN_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    FIXED_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    READINGS_FIELD_NUMBER: _ClassVar[int]
    name: str
    field: str
    device: str
    above: float
    below: float
    dead_band: float
    on_delay_s: float
    off_delay_s: float
    level: str
    unknown: str
    unit: str
    fixed: bool
    user: str
    readings: _containers.RepeatedCompositeFieldContainer[AlarmLimit.Reading]
    def __init__(self, name: _Optional[str] = ..., field: _Optional[str] = ..., device: _Optional[str] = ..., above: _Optional[float] = ..., below: _Optional[float] = ..., dead_band: _Optional[float] = ..., on_delay_s: _Optional[float] = ..., off_delay_s: _Optional[float] = ..., level: _Optional[str] = ..., unknown: _Optional[str] = ..., unit: _Optional[str] = ..., fixed: _Optional[bool] = ..., user: _Optional[str] = ..., readings: _Optional[_Iterable[_Union[AlarmLimit.Reading, _Mapping]]] = ...) -> None: ...

class AlarmCommand(_message.Message):
    __slots__ = ("action", "device", "id", "user", "text", "seconds", "limit")
    class Action(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        ACTION_LIST: _ClassVar[AlarmCommand.Action]
        ACTION_ACKNOWLEDGE: _ClassVar[AlarmCommand.Action]
        ACTION_SHELVE: _ClassVar[AlarmCommand.Action]
        ACTION_UNSHELVE: _ClassVar[AlarmCommand.Action]
        ACTION_SET_LIMIT: _ClassVar[AlarmCommand.Action]
        ACTION_REMOVE_LIMIT: _ClassVar[AlarmCommand.Action]
        ACTION_TEST: _ClassVar[AlarmCommand.Action]
    ACTION_LIST: AlarmCommand.Action
    ACTION_ACKNOWLEDGE: AlarmCommand.Action
    ACTION_SHELVE: AlarmCommand.Action
    ACTION_UNSHELVE: AlarmCommand.Action
    ACTION_SET_LIMIT: AlarmCommand.Action
    ACTION_REMOVE_LIMIT: AlarmCommand.Action
    ACTION_TEST: AlarmCommand.Action
    ACTION_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    action: AlarmCommand.Action
    device: str
    id: str
    user: str
    text: str
    seconds: float
    limit: AlarmLimit
    def __init__(self, action: _Optional[_Union[AlarmCommand.Action, str]] = ..., device: _Optional[str] = ..., id: _Optional[str] = ..., user: _Optional[str] = ..., text: _Optional[str] = ..., seconds: _Optional[float] = ..., limit: _Optional[_Union[AlarmLimit, _Mapping]] = ...) -> None: ...

class AlarmReply(_message.Message):
    __slots__ = ("ok", "message", "alarms", "limits", "history", "ways", "trouble")
    class Event(_message.Message):
        __slots__ = ("utc_ns", "device", "id", "title", "level", "what", "who", "text")
        UTC_NS_FIELD_NUMBER: _ClassVar[int]
        DEVICE_FIELD_NUMBER: _ClassVar[int]
        ID_FIELD_NUMBER: _ClassVar[int]
        TITLE_FIELD_NUMBER: _ClassVar[int]
        LEVEL_FIELD_NUMBER: _ClassVar[int]
        WHAT_FIELD_NUMBER: _ClassVar[int]
        WHO_FIELD_NUMBER: _ClassVar[int]
        TEXT_FIELD_NUMBER: _ClassVar[int]
        utc_ns: int
        device: str
        id: str
        title: str
        level: Alarm.Level
        what: str
        who: str
        text: str
        def __init__(self, utc_ns: _Optional[int] = ..., device: _Optional[str] = ..., id: _Optional[str] = ..., title: _Optional[str] = ..., level: _Optional[_Union[Alarm.Level, str]] = ..., what: _Optional[str] = ..., who: _Optional[str] = ..., text: _Optional[str] = ...) -> None: ...
    class Way(_message.Message):
        __slots__ = ("name", "sent", "waiting", "given_up", "fault")
        NAME_FIELD_NUMBER: _ClassVar[int]
        SENT_FIELD_NUMBER: _ClassVar[int]
        WAITING_FIELD_NUMBER: _ClassVar[int]
        GIVEN_UP_FIELD_NUMBER: _ClassVar[int]
        FAULT_FIELD_NUMBER: _ClassVar[int]
        name: str
        sent: int
        waiting: int
        given_up: int
        fault: str
        def __init__(self, name: _Optional[str] = ..., sent: _Optional[int] = ..., waiting: _Optional[int] = ..., given_up: _Optional[int] = ..., fault: _Optional[str] = ...) -> None: ...
    OK_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    ALARMS_FIELD_NUMBER: _ClassVar[int]
    LIMITS_FIELD_NUMBER: _ClassVar[int]
    HISTORY_FIELD_NUMBER: _ClassVar[int]
    WAYS_FIELD_NUMBER: _ClassVar[int]
    TROUBLE_FIELD_NUMBER: _ClassVar[int]
    ok: bool
    message: str
    alarms: _containers.RepeatedCompositeFieldContainer[Alarm]
    limits: _containers.RepeatedCompositeFieldContainer[AlarmLimit]
    history: _containers.RepeatedCompositeFieldContainer[AlarmReply.Event]
    ways: _containers.RepeatedCompositeFieldContainer[AlarmReply.Way]
    trouble: str
    def __init__(self, ok: _Optional[bool] = ..., message: _Optional[str] = ..., alarms: _Optional[_Iterable[_Union[Alarm, _Mapping]]] = ..., limits: _Optional[_Iterable[_Union[AlarmLimit, _Mapping]]] = ..., history: _Optional[_Iterable[_Union[AlarmReply.Event, _Mapping]]] = ..., ways: _Optional[_Iterable[_Union[AlarmReply.Way, _Mapping]]] = ..., trouble: _Optional[str] = ...) -> None: ...

class LogLevelCommand(_message.Message):
    __slots__ = ("level", "seconds", "user")
    LEVEL_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    USER_FIELD_NUMBER: _ClassVar[int]
    level: str
    seconds: float
    user: str
    def __init__(self, level: _Optional[str] = ..., seconds: _Optional[float] = ..., user: _Optional[str] = ...) -> None: ...

class Beat(_message.Message):
    __slots__ = ("header", "role", "session", "since_utc_ns", "devices", "viewers", "leaving", "certificate_ends_utc_ns", "certificate_life_s", "certificate", "clock_ahead_s", "clock_bound_s", "version", "loop", "turn_ago_s", "turn_most_s", "doing", "told_by")
    class Viewers(_message.Message):
        __slots__ = ("role", "count")
        ROLE_FIELD_NUMBER: _ClassVar[int]
        COUNT_FIELD_NUMBER: _ClassVar[int]
        role: str
        count: int
        def __init__(self, role: _Optional[str] = ..., count: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ROLE_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    SINCE_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    DEVICES_FIELD_NUMBER: _ClassVar[int]
    VIEWERS_FIELD_NUMBER: _ClassVar[int]
    LEAVING_FIELD_NUMBER: _ClassVar[int]
    CERTIFICATE_ENDS_UTC_NS_FIELD_NUMBER: _ClassVar[int]
    CERTIFICATE_LIFE_S_FIELD_NUMBER: _ClassVar[int]
    CERTIFICATE_FIELD_NUMBER: _ClassVar[int]
    CLOCK_AHEAD_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_BOUND_S_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    LOOP_FIELD_NUMBER: _ClassVar[int]
    TURN_AGO_S_FIELD_NUMBER: _ClassVar[int]
    TURN_MOST_S_FIELD_NUMBER: _ClassVar[int]
    DOING_FIELD_NUMBER: _ClassVar[int]
    TOLD_BY_FIELD_NUMBER: _ClassVar[int]
    header: Header
    role: str
    session: str
    since_utc_ns: int
    devices: _containers.RepeatedScalarFieldContainer[str]
    viewers: _containers.RepeatedCompositeFieldContainer[Beat.Viewers]
    leaving: bool
    certificate_ends_utc_ns: int
    certificate_life_s: float
    certificate: str
    clock_ahead_s: float
    clock_bound_s: float
    version: str
    loop: str
    turn_ago_s: float
    turn_most_s: float
    doing: str
    told_by: str
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., role: _Optional[str] = ..., session: _Optional[str] = ..., since_utc_ns: _Optional[int] = ..., devices: _Optional[_Iterable[str]] = ..., viewers: _Optional[_Iterable[_Union[Beat.Viewers, _Mapping]]] = ..., leaving: _Optional[bool] = ..., certificate_ends_utc_ns: _Optional[int] = ..., certificate_life_s: _Optional[float] = ..., certificate: _Optional[str] = ..., clock_ahead_s: _Optional[float] = ..., clock_bound_s: _Optional[float] = ..., version: _Optional[str] = ..., loop: _Optional[str] = ..., turn_ago_s: _Optional[float] = ..., turn_most_s: _Optional[float] = ..., doing: _Optional[str] = ..., told_by: _Optional[str] = ...) -> None: ...

class ClockReply(_message.Message):
    __slots__ = ("received_ns", "answered_ns", "wall_ns")
    RECEIVED_NS_FIELD_NUMBER: _ClassVar[int]
    ANSWERED_NS_FIELD_NUMBER: _ClassVar[int]
    WALL_NS_FIELD_NUMBER: _ClassVar[int]
    received_ns: int
    answered_ns: int
    wall_ns: int
    def __init__(self, received_ns: _Optional[int] = ..., answered_ns: _Optional[int] = ..., wall_ns: _Optional[int] = ...) -> None: ...
