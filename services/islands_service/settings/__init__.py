"""Settings of the service, and checks of their values."""

from islands_service.settings.service_settings import LOOPBACK, ServiceSettings, service_settings

__all__ = ["LOOPBACK", "ServiceSettings", "service_settings"]
